#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"
#include "registration/images/image_pyramid.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Eigen::Vector3i;
using registration::ct_in_reach;

/// A grid around the ultrasound, far larger than its reach; it has no voxels, since none are read.
CtVolume vast_ct(const RegistrationCase& images, int voxels) {
  CtVolume ct;
  ct.grid = images.ct.grid;
  const Vector3d centre = images.ct.grid.centre_mm();
  ct.grid.size = Vector3i::Constant(voxels);
  ct.grid.origin_mm += centre - ct.grid.centre_mm();
  return ct;
}

TEST(CtInReach, DoesNotGrowWithTheCt) {
  const SearchOptions options = quick_options().search;
  const CtVolume small = vast_ct(agar_case(), 400);
  const CtVolume large = vast_ct(agar_case(), 1000);
  const BeamGrid& beams = agar_case().us.beams;
  const Isometry3d initial = nearby(agar_case());
  const Region a = ct_in_reach(small, beams, initial, options).region;
  const Region b = ct_in_reach(large, beams, initial, options).region;
  EXPECT_GT(a.size.minCoeff(), 20);
  EXPECT_EQ(a.size, b.size);
  EXPECT_EQ(a.begin + Vector3i::Constant(300), b.begin);
  EXPECT_LT(a.size.maxCoeff(), 300);
}

/// A probe that goes there and back often: frames at any even distance may all lie at one end.
TEST(CtInReach, HoldsEveryFrameOfASweepThatComesBack) {
  const CtVolume ct = vast_ct(agar_case(), 400);
  const BeamGrid once = agar_case().us.beams;
  BeamGrid beams = once;
  constexpr int kCycle = 10;
  beams.frames = 6 * kCycle + 1;
  beams.beams.clear();
  for (int f = 0; f < beams.frames; ++f) {
    const int there = std::min(f % kCycle, kCycle - f % kCycle);
    const int from = there * (once.frames - 1) / (kCycle / 2);
    const auto begin = once.beams.begin() + static_cast<std::ptrdiff_t>(from) * once.lines;
    beams.beams.insert(beams.beams.end(), begin, begin + once.lines);
  }
  const SearchOptions options = quick_options().search;
  const Isometry3d initial = nearby(agar_case());
  const Region of_once = ct_in_reach(ct, once, initial, options).region;
  const Region of_all = ct_in_reach(ct, beams, initial, options).region;
  EXPECT_LE((of_all.begin - of_once.begin).cwiseAbs().maxCoeff(), 1);
  EXPECT_LE((of_all.size - of_once.size).cwiseAbs().maxCoeff(), 2);
}

TEST(CtInReach, HoldsTheFieldOfViewAtAllStarts) {
  const CtVolume ct = vast_ct(agar_case(), 1000);
  const BeamGrid& beams = agar_case().us.beams;
  const Isometry3d initial = nearby(agar_case());
  std::vector<Vector3d> points;
  for (int f = 0; f < beams.frames; f += 5)
    for (int l = 0; l < beams.lines; l += 5)
      for (const int s : {0, beams.samples() / 2, beams.samples() - 1})
        points.push_back(beams.point(f, l, s));
  const PoseParameters pose(initial, points);
  for (const StartRegion region : {StartRegion::kBox, StartRegion::kBall})
    for (const double rotation_deg : {0.0, 25.0, 100.0}) {
      SearchOptions options = quick_options().search;
      StartOptions& starts = *options.starts;
      starts.region = region;
      starts.count = 512;
      starts.rotation_rad = rotation_deg * kDegree;
      const Region reach = ct_in_reach(ct, beams, initial, options).region;
      std::size_t outside = 0;
      std::size_t all = 0;
      for (const PoseVector& start : spread_starts(pose, starts)) {
        const Isometry3d T_ct_us = pose.T_us_ct(start).inverse();
        for (const Vector3d& p : points) {
          const Vector3d index = ct.grid.index_from_physical(T_ct_us * p);
          const Vector3d from_begin = index - reach.begin.cast<double>();
          ++all;
          if (from_begin.minCoeff() < 0.0 ||
              (from_begin - (reach.size.cast<double>() - Vector3d::Ones())).maxCoeff() > 0.0)
            ++outside;
        }
      }
      EXPECT_LT(static_cast<double>(outside), 0.001 * static_cast<double>(all))
          << static_cast<int>(region) << " " << rotation_deg << " " << outside << "/" << all;
    }
}

}  // namespace
}  // namespace usct::test
