#include <gtest/gtest.h>

#include <set>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/rendering/point_clouds.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

namespace usct {
namespace {

using Eigen::Vector3d;

/// A volume of 7 samples x 3 lines x 5 frames; the brightness encodes frame, line and sample.
PreScanVolume volume() {
  PreScanVolume result;
  result.geometry = {{7, 3.0, 0.4},
                     CurvilinearArray{40.0, {-0.1, 0.0, 0.1}},
                     MotorSweep{27.25, {-0.2, -0.1, 0.0, 0.1, 0.3}, 0.0}};
  for (int frame = 0; frame < 5; ++frame)
    for (int line = 0; line < 3; ++line)
      for (int sample = 0; sample < 7; ++sample)
        result.voxels.push_back(static_cast<std::uint8_t>(40 * frame + 10 * line + sample));
  return result;
}

TEST(CrossedFans, AreTheMiddleFrameAndTheMiddleLinesWhereTheSamplesLie) {
  const PreScanVolume us = volume();
  const std::vector<CloudPoint> points = crossed_fans(along_beams(us), 0.1);
  EXPECT_EQ(points.size(), 7u * (3 + 4));
  for (const CloudPoint& point : points) {
    const int code = static_cast<int>(point.intensity);
    const int frame = code / 40, line = code % 40 / 10, sample = code % 10;
    EXPECT_TRUE(frame == 2 || line == 1) << code;
    const Vector3d expected = us_from_scan(us.geometry, {1.0 * sample, 1.0 * line, 1.0 * frame});
    EXPECT_LT((point.p_mm - expected).norm(), 1e-9) << code;
  }
}

TEST(CrossedFans, LeaveSamplesOutThatAreCloserThanTheSpacing) {
  // Spacing 0.8 mm is two samples: 0, 2, 4, 6.
  EXPECT_EQ(crossed_fans(along_beams(volume()), 0.8).size(), 4u * (3 + 4));
  EXPECT_EQ(crossed_fans(along_beams(volume()), 0.9).size(), 3u * (3 + 4));
}

TEST(WholeVolume, HasEverySampleWhereItLies) {
  const PreScanVolume us = volume();
  const std::vector<CloudPoint> points = whole_volume(along_beams(us), 0.1);
  ASSERT_EQ(points.size(), 7u * 3 * 5);
  std::set<int> codes;
  for (const CloudPoint& point : points) {
    const int code = static_cast<int>(point.intensity);
    const Vector3d expected =
        us_from_scan(us.geometry, {1.0 * (code % 10), 1.0 * (code % 40 / 10), 1.0 * (code / 40)});
    EXPECT_LT((point.p_mm - expected).norm(), 1e-9) << code;
    codes.insert(code);
  }
  EXPECT_EQ(codes.size(), points.size());
}

TEST(WholeVolume, IsAveragedToTheSpacing) {
  // Spacing 0.8 mm is two samples; lines and frames are millimetres apart. The last of seven
  // samples is left over.
  const PreScanVolume us = volume();
  const std::vector<CloudPoint> points = whole_volume(along_beams(us), 0.8);
  ASSERT_EQ(points.size(), 3u * 3 * 5);
  EXPECT_EQ(points.front().intensity, 0.5F);
  EXPECT_LT((points.front().p_mm - us_from_scan(us.geometry, {0.5, 0.0, 0.0})).norm(), 1e-9);
}

TEST(Field, LiesInTheMiddleOfWhatIsSeenAndIsTurnedLikeTheUltrasound) {
  PreScanVolume us = volume();
  EXPECT_TRUE(T_us_acquired(us.geometry).isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_TRUE(T_us_field(us.geometry).linear().isApprox(Eigen::Matrix3d::Identity()));
  // The motor stands at 0: 3 samples of 0.4 mm below the start depth and the radius.
  EXPECT_LT((T_us_field(us.geometry).translation() - Vector3d(0.0, 44.2, 0.0)).norm(), 1e-9);

  const Eigen::Isometry3d T_us_image =
      Eigen::Translation3d(500.0, 0.0, 0.0) * Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitZ());
  us.geometry.motion =
      TrackedSweep{{Eigen::Isometry3d::Identity(), T_us_image, Eigen::Isometry3d::Identity()}, {}};
  EXPECT_TRUE(T_us_acquired(us.geometry).isApprox(T_us_image));
  EXPECT_TRUE(T_us_field(us.geometry).linear().isApprox(T_us_image.linear()));
  EXPECT_LT((T_us_field(us.geometry).translation() - Vector3d(455.8, 0.0, 0.0)).norm(), 1e-9);
}

TEST(CtAt, SamplesTheCtAtThePlacesAndLeavesOutWhatIsOutsideIt) {
  Grid grid;
  grid.size = {10, 10, 10};
  CtVolume ct(grid);
  for (int k = 0; k < 10; ++k)
    for (int j = 0; j < 10; ++j)
      for (int i = 0; i < 10; ++i) ct.at(i, j, k) = static_cast<std::int16_t>(100 * i + 10 * j + k);
  const Eigen::Isometry3d T_ct_points =
      Eigen::Translation3d(1.0, 2.0, 3.0) * Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitZ());
  // (x, y, z) goes to (1 - y, 2 + x, 3 + z).
  const std::vector<CloudPoint> found =
      ct_at({{{4.5, -1.25, 2.0}, 7.0F}, {{0.0, 20.0, 0.0}, 7.0F}}, ct, T_ct_points);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].p_mm, Vector3d(4.5, -1.25, 2.0));
  EXPECT_NEAR(found[0].intensity, 100 * 2.25 + 10 * 6.5 + 5.0, 1e-3);
}

}  // namespace
}  // namespace usct
