#include <gtest/gtest.h>

#include "us_ct_registration/volume/sampling.h"

namespace usct {
namespace {

TEST(Sampling, TrilinearReproducesAnAffineFunction) {
  Grid grid;
  grid.size = {5, 6, 7};
  grid.spacing_mm = {0.5, 1.0, 2.0};
  grid.origin_mm = {-3.0, 4.0, 10.0};
  grid.direction = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  const Eigen::Vector3d gradient(3.0, -2.0, 0.5);
  Volume<float> volume(grid);
  for (int k = 0; k < 7; ++k)
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 5; ++i)
        volume.at(i, j, k) =
            static_cast<float>(gradient.dot(grid.physical_from_index(Eigen::Vector3d(i, j, k))));
  const Eigen::Vector3d p = grid.physical_from_index({2.3, 4.1, 5.9});
  EXPECT_NEAR(sample(volume, p, Interpolation::kTrilinear, Outside::constant(0)), gradient.dot(p),
              1e-4);
}

}  // namespace
}  // namespace usct
