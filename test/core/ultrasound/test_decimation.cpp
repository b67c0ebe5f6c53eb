#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "core/geometry/random_geometry.h"
#include "core/simulation/simple_scenes.h"
#include "core/ultrasound/sample_index.h"
#include "ultrasound/decimation.h"
#include "us_ct_registration/error.h"
#include "with_threads.h"

namespace usct::test {
namespace {

BeamUltrasound random_ultrasound(bool masked) {
  ScanGeometry geometry;
  geometry.axial = {integer(2, 20), 3.0, 0.7};
  geometry.array = CurvilinearArray{40.0, centred_table(integer(2, 12), 0.02)};
  geometry.motion = MotorSweep{27.0, centred_table(integer(2, 8), 0.03), 0.0};
  BeamUltrasound us{beam_grid(geometry), {}, {}};
  for (std::size_t i = 0; i < us.beams.beams.size() * static_cast<std::size_t>(us.beams.samples());
       ++i) {
    us.brightness.push_back(static_cast<float>((i * 7919) % 251));
    if (masked) us.known.push_back((i * 104729) % 97 < 50 ? 255 : 0);
    if (masked && us.known.back() == 0)
      us.brightness.back() = std::numeric_limits<float>::quiet_NaN();
  }
  return us;
}

RC_GTEST_PROP(Decimation, MeansOfWhatIsKnownInTheMiddleOfBlocks, ()) {
  const bool masked = *rc::gen::arbitrary<bool>();
  const BeamUltrasound us = random_ultrasound(masked);
  const Eigen::Vector3i factors(integer(1, us.beams.samples() + 1), integer(1, us.beams.lines + 1),
                                integer(1, us.beams.frames + 1));
  const BeamUltrasound small = decimate(us, factors);
  RC_ASSERT(small.beams.samples() == us.beams.samples() / factors.x());
  RC_ASSERT(small.beams.lines == us.beams.lines / factors.y());
  RC_ASSERT(small.beams.frames == us.beams.frames / factors.z());
  RC_ASSERT(small.beams.axial.spacing_mm == us.beams.axial.spacing_mm * factors.x());
  small.validate();
  for (int f = 0; f < small.beams.frames; ++f)
    for (int l = 0; l < small.beams.lines; ++l)
      for (int s = 0; s < small.beams.samples(); ++s) {
        double sum = 0.0;
        int known = 0;
        Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
        Eigen::Vector3d direction = Eigen::Vector3d::Zero();
        double depth_mm = 0.0;
        for (int df = 0; df < factors.z(); ++df)
          for (int dl = 0; dl < factors.y(); ++dl)
            for (int ds = 0; ds < factors.x(); ++ds) {
              const int frame = f * factors.z() + df;
              const int line = l * factors.y() + dl;
              const int sample = s * factors.x() + ds;
              const std::size_t i = at(us.beams, sample, line, frame);
              if (us.known.empty() || us.known[i] != 0) {
                sum += us.brightness[i];
                ++known;
              }
              origin_mm += us.beams.beam(frame, line).origin_mm / factors.prod();
              direction += us.beams.beam(frame, line).direction;
              depth_mm += us.beams.axial.depth_mm(sample) / factors.prod();
            }
        const std::size_t i = at(small.beams, s, l, f);
        const bool counts = 2 * known >= factors.prod();
        RC_ASSERT((small.known.empty() || small.known[i] != 0) == counts);
        if (counts) RC_ASSERT(std::abs(small.brightness[i] - sum / known) < 1e-3);
        const Eigen::Vector3d expected = origin_mm + depth_mm * direction.normalized();
        RC_ASSERT((small.beams.point(f, l, s) - expected).norm() < 1e-9);
      }
}

TEST(Decimation, ByOneChangesNothing) {
  BeamUltrasound us{downward_beams(5, 4, 3), std::vector<float>(60, 2.0F), {}};
  us.brightness[17] = 9.0F;
  const BeamUltrasound same = decimate(us, {1, 1, 1});
  EXPECT_EQ(same.brightness, us.brightness);
  EXPECT_EQ(same.beams.beams.size(), us.beams.beams.size());
}

TEST(Decimation, ABlockOfWhichHalfIsKnownIsKnown) {
  BeamUltrasound us{downward_beams(4, 2, 1), {1, 2, 3, 4, 5, 6, 7, 8}, {1, 0, 1, 0, 0, 1, 0, 0}};
  const BeamUltrasound small = decimate(us, {2, 2, 1});
  EXPECT_EQ(small.known, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(small.brightness[0], 3.5F);
}

TEST(Decimation, SameBitsForAnyNumberOfThreads) {
  BeamUltrasound us{downward_beams(40, 12, 30), {}, {}};
  for (int i = 0; i < 40 * 12 * 30; ++i)
    us.brightness.push_back(0.1F * static_cast<float>((i * 7919) % 251));
  const auto coarse = [&] { return decimate(us, {3, 2, 4}); };
  const BeamUltrasound one = with_threads(1, coarse);
  const BeamUltrasound three = with_threads(3, coarse);
  EXPECT_EQ(one.brightness, three.brightness);
}

TEST(Decimation, FactorsComeClosestToASpacing) {
  BeamGrid beams = downward_beams(60, 40, 20);  // 1 mm lines, and frames ...
  beams.axial.spacing_mm = 0.4;
  for (Beam& beam : beams.beams) beam.origin_mm.z() *= 1.7;
  EXPECT_EQ(factors_for_spacing(beams, 1.0), Eigen::Vector3i(3, 1, 1));  // 1.2, 1, 1.7 mm
  EXPECT_EQ(factors_for_spacing(beams, 2.0), Eigen::Vector3i(5, 2, 1));
  EXPECT_EQ(factors_for_spacing(beams, 4.0), Eigen::Vector3i(10, 4, 2));
  EXPECT_EQ(factors_for_spacing(beams, 0.01), Eigen::Vector3i(1, 1, 1));
  EXPECT_EQ(factors_for_spacing(beams, 1000.0), Eigen::Vector3i(30, 20, 10));
  EXPECT_EQ(factors_for_spacing(downward_beams(60, 40, 1), 2.0), Eigen::Vector3i(2, 2, 1));
}

TEST(Decimation, RefusesFactorsAndSpacingsThatAreWrong) {
  const BeamUltrasound us{downward_beams(5, 4, 3), std::vector<float>(60, 2.0F), {}};
  EXPECT_THROW(decimate(us, {0, 1, 1}), InputError);
  EXPECT_THROW(decimate(us, {1, 5, 1}), InputError);
  EXPECT_THROW(factors_for_spacing(us.beams, 0.0), InputError);
  EXPECT_THROW(factors_for_spacing(us.beams, std::nan("")), InputError);
}

}  // namespace
}  // namespace usct::test
