#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/geometry/random_geometry.h"
#include "core/simulation/simple_scenes.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/simulation/simulation.h"
#include "with_threads.h"

namespace usct::test {
namespace {

const Eigen::Isometry3d kIdentity = Eigen::Isometry3d::Identity();
constexpr int kSize = 41;    // voxels and mm along each side of the CT
constexpr int kMiddle = 20;  // sample at y = 0

SimulatedComponents simulate(const CtVolume& ct, const BeamGrid& beams,
                             const SimulationOptions& options = {},
                             const Eigen::Isometry3d& T_ct_us = kIdentity) {
  return simulate_components(beams, ct, T_ct_us, options);
}

TEST(Simulation, RampAlongTheBeamGivesTheValuesOfTheEquations) {
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return 10.0 * p.y(); });
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1));
  double intensity = 1.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(kSize); ++i) {
    const double mu = 1000.0 + 10.0 * (static_cast<double>(i) - kMiddle);
    const double change = 10.0 / (2.0 * mu);
    EXPECT_NEAR(s.ct_hu[i], mu - 1000.0, 1e-3);
    EXPECT_NEAR(s.gradient_hu_per_mm[i], 10.0, 1e-4);  // the CT's edges included
    EXPECT_NEAR(s.reflection_coefficient[i], change * change, 1e-9);
    EXPECT_NEAR(s.transmission[i], 1.0 - change * change, 1e-7);
    const double r = intensity * change * change;
    EXPECT_NEAR(s.reflection[i], std::log(1.0 + 15.0 * 100.0 * r) / std::log(16.0), 1e-5);
    intensity *= 1.0 - change * change;
    EXPECT_NEAR(s.intensity[i], intensity, 1e-6);
    EXPECT_NEAR(s.mapped_ct[i], std::clamp(1.36 * mu - 1429.0, 0.0, 255.0), 1e-3);
    EXPECT_EQ(s.flags[i], 0);
  }
}

TEST(Simulation, ObliqueInterfaceReflectsByTheCosineAndTransmitsRegardlessOfAngle) {
  // 30 HU/mm along a normal at 60 degrees to the beam.
  const Eigen::Vector3d normal(std::sin(60.0 * kDegree), std::cos(60.0 * kDegree), 0.0);
  Volume<std::int16_t> ct =
      ct_of(centred_grid(kSize, 1.0), [&](const auto& p) { return 30.0 * normal.dot(p); });
  const SimulatedComponents s = simulate(ct, downward_beams(5, 1, 1));
  const double change = 30.0 / 2000.0;
  // Whole HU: the gradient is right to within half a HU over two voxels.
  EXPECT_NEAR(s.gradient_hu_per_mm[2], 30.0, 0.5);
  EXPECT_NEAR(s.reflection_coefficient[2], 0.5 * change * change, 0.02 * change * change);
  EXPECT_NEAR(1.0 - s.transmission[2], change * change, 0.04 * change * change);
}

TEST(Simulation, StepIsSpreadByTheCentralDifference) {
  // 0 HU above y = 0.5 mm, 100 HU below: central differences see 50 HU/mm on either side.
  const CtVolume ct =
      ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return p.y() > 0.25 ? 100.0 : 0.0; });
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1));
  const double above = 50.0 / 2000.0;
  const double below = 50.0 / 2200.0;
  EXPECT_EQ(s.reflection_coefficient[kMiddle - 1], 0.0F);
  EXPECT_NEAR(s.reflection_coefficient[kMiddle], above * above, 1e-9);
  EXPECT_NEAR(s.reflection_coefficient[kMiddle + 1], below * below, 1e-9);
  EXPECT_EQ(s.reflection_coefficient[kMiddle + 2], 0.0F);
  EXPECT_NEAR(s.intensity[kSize - 1], (1.0 - above * above) * (1.0 - below * below), 1e-6);
}

TEST(Simulation, GradientIsPerMillimetreWhateverTheVoxels) {
  for (const double spacing : {0.5, 1.0, 2.0}) {
    const CtVolume ct =
        ct_of(centred_grid(41, spacing), [](const auto& p) { return 20.0 * p.y(); });
    SimulationOptions options;
    options.gradient_length_mm = 3.0;
    const SimulatedComponents s = simulate(ct, downward_beams(1, 1, 1), options);
    EXPECT_NEAR(s.gradient_hu_per_mm[0], 20.0, 1e-3) << spacing;
    EXPECT_NEAR(s.transmission[0], 1.0 - 0.03 * 0.03, 1e-6) << spacing;
  }
}

TEST(Simulation, HomogeneousTissueReflectsNothing) {
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto&) { return 60.0; });
  for (const Interpolation interpolation : {Interpolation::kNearest, Interpolation::kTrilinear}) {
    SimulationOptions options;
    options.interpolation = interpolation;
    // Beyond the CT as well: its border is no interface.
    const SimulatedComponents s = simulate(ct, downward_beams(61, 3, 2), options);
    for (std::size_t i = 0; i < s.count(); ++i) {
      EXPECT_EQ(s.reflection[i], 0.0F);
      EXPECT_EQ(s.transmission[i], 1.0F);
      EXPECT_EQ(s.intensity[i], 1.0F);
    }
  }
}

TEST(Simulation, OutsideTheCtIsBackgroundAndFlagged) {
  const CtVolume ct = ct_of(centred_grid(11, 1.0), [](const auto&) { return 120.0; });
  SimulationOptions options;
  options.outside_hu = 70.0;
  const SimulatedComponents s = simulate(ct, downward_beams(31, 1, 1), options);
  for (std::size_t i = 0; i < s.count(); ++i) {
    const bool inside = i >= 10 && i <= 20;
    EXPECT_EQ(s.flags[i], inside ? 0 : int{kOutsideCt}) << i;
    EXPECT_EQ(s.ct_hu[i], inside ? 120.0F : 70.0F) << i;
    EXPECT_NEAR(s.mapped_ct[i], 1.36 * (inside ? 1120.0 : 1070.0) - 1429.0, 1e-3) << i;
  }
}

TEST(Simulation, NothingIsSeenBehindBoneAndTheBoneReflectsAllThatArrives) {
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) {
    return p.y() >= 5.0 && p.y() < 8.0 && p.x() < 0.0 ? 900.0 : 40.0;
  });
  SimulationOptions options;
  options.occlusion.by_threshold = true;
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 11, 1), options);
  for (int sample = 0; sample < kSize; ++sample) {
    const std::size_t blocked = s.offset(sample, 2, 0);  // x = -3
    EXPECT_EQ((s.flags[blocked] & kOccluded) != 0, sample >= kMiddle + 5) << sample;
    EXPECT_EQ(s.intensity[blocked] == 0.0F, sample >= kMiddle + 5) << sample;
    const std::size_t open = s.offset(sample, 8, 0);  // x = +3
    EXPECT_EQ(s.flags[open], 0) << sample;
    EXPECT_EQ(s.intensity[open], 1.0F) << sample;
  }
  EXPECT_EQ(s.reflection[s.offset(kMiddle + 5, 2, 0)], 1.0F);
  EXPECT_EQ(s.reflection[s.offset(kMiddle + 6, 2, 0)], 0.0F);

  options.occlusion.by_threshold = false;
  const SimulatedComponents open = simulate(ct, downward_beams(kSize, 11, 1), options);
  EXPECT_GT(open.intensity[open.offset(kSize - 1, 2, 0)], 0.0F);
}

TEST(Simulation, BoneEchoesForTheGivenLengthAndIsSeenAsLongAsThat) {
  // Beams from above meet bone at y = 5, which is thinner than its echo is long.
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) {
    return p.y() >= 5.0 && p.y() < 7.0 ? 900.0 : 40.0;
  });
  SimulationOptions options;
  options.occlusion.by_threshold = true;
  for (const double echo_mm : {0.5, 2.0, 3.5}) {
    options.occlusion.echo_mm = echo_mm;
    const SimulatedComponents s = simulate(ct, downward_beams(kSize, 3, 1), options);
    for (int sample = kMiddle + 5; sample < kSize; ++sample) {
      const std::size_t at = s.offset(sample, 1, 0);
      const bool echoes = sample - (kMiddle + 5) < echo_mm;
      EXPECT_EQ(s.reflection[at], echoes ? 1.0F : 0.0F) << echo_mm << ' ' << sample;
      EXPECT_EQ((s.flags[at] & kOccluded) == 0, echoes) << echo_mm << ' ' << sample;
      EXPECT_EQ(s.intensity[at], 0.0F) << echo_mm << ' ' << sample;
    }
  }
}

TEST(Simulation, AnEchoHasTheReflectionOfTheSoundThatArrives) {
  // A ramp takes a part of the sound before the bone; eq 4.7 with a = 15, s = 1.
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) {
    return p.y() >= 8.0 ? 900.0 : p.y() < 0.0 ? -300.0 : -300.0 + 80.0 * p.y();
  });
  SimulationOptions options;
  options.occlusion.by_threshold = true;
  options.occlusion.echo_mm = 2.0;
  options.reflection_scale = 1.0;
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 3, 1), options);
  const double arrives = s.intensity[s.offset(kMiddle + 7, 1, 0)];
  ASSERT_GT(arrives, 0.1);
  ASSERT_LT(arrives, 0.99);
  const double expected = std::log(1.0 + 15.0 * arrives) / std::log(16.0);
  EXPECT_NEAR(s.reflection[s.offset(kMiddle + 8, 1, 0)], expected, 1e-6);
  EXPECT_NEAR(s.reflection[s.offset(kMiddle + 9, 1, 0)], expected, 1e-6);
  EXPECT_EQ(s.reflection[s.offset(kMiddle + 10, 1, 0)], 0.0F);
}

TEST(Simulation, GasOccludesInTheBodyButAirInFrontOfItDoesNot) {
  // Air to y = -10, a gas bubble at y = 5..6.
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) {
    return p.y() < -10.0 || (p.y() > 4.5 && p.y() < 6.5) ? -950.0 : 40.0;
  });
  SimulationOptions options;
  options.occlusion.by_threshold = true;
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1), options);
  for (std::size_t i = 0; i < s.count(); ++i) {
    const double y = static_cast<double>(i) - kMiddle;
    // The skin's own gradient reaches to y = -10: the body begins where it is free of air.
    EXPECT_EQ((s.flags[i] & kBeforeBody) != 0, y < -9.5) << y;
    EXPECT_EQ((s.flags[i] & kOccluded) != 0, y >= 4.5) << y;
  }
}

TEST(Simulation, AGradientThresholdOccludes) {
  const CtVolume ct =
      ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return p.y() > 0.25 ? 300.0 : 0.0; });
  SimulationOptions options;
  options.occlusion.by_threshold = true;
  options.occlusion.gradient_hu_per_mm = 151.0;  // the step is 150 HU/mm
  EXPECT_GT(simulate(ct, downward_beams(kSize, 1, 1), options).intensity.back(), 0.0F);
  options.occlusion.gradient_hu_per_mm = 149.0;
  EXPECT_EQ(simulate(ct, downward_beams(kSize, 1, 1), options).intensity.back(), 0.0F);
}

TEST(Simulation, TransmissionNeverFallsBelowZero) {
  // From 0 to -1000 HU within a voxel: |grad mu| / 2 mu = 500 / 100 at the floor of mu.
  const CtVolume ct =
      ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return p.y() > 0.25 ? -1000.0 : 0.0; });
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1));
  for (std::size_t i = 0; i < s.count(); ++i) {
    EXPECT_GE(s.transmission[i], 0.0F);
    EXPECT_LE(std::abs(s.reflection_coefficient[i]), 1.0F);
  }
  EXPECT_EQ(s.transmission[kMiddle + 1], 0.0F);
  EXPECT_EQ(s.reflection_coefficient[kMiddle + 1], -1.0F);
  EXPECT_EQ(s.flags[kMiddle + 1], kOccluded);
}

TEST(Simulation, LogCompressionAsPrintedShowsTheSoundThatIsLost) {
  const CtVolume ct =
      ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return p.y() > 0.25 ? 400.0 : 0.0; });
  SimulationOptions options;
  options.log_compression = LogCompression::kIntensity;
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1), options);
  EXPECT_EQ(s.reflection[0], 0.0F);
  const double lost = (1.0 - 0.01) * (1.0 - std::pow(200.0 / 2800.0, 2.0));
  for (std::size_t i = kMiddle + 1; i < s.count(); ++i)
    EXPECT_NEAR(s.reflection[i], 1.0 - std::log(1.0 + 15.0 * lost) / std::log(16.0), 1e-6);
}

TEST(Simulation, SignTellsRisingFromFallingOnlyOnRequest) {
  const CtVolume up = ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return 5.0 * p.y(); });
  const CtVolume down = ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return -5.0 * p.y(); });
  SimulationOptions options;
  const auto middle = [&](const CtVolume& ct) {
    return simulate(ct, downward_beams(1, 1, 1), options).reflection[0];
  };
  EXPECT_GT(middle(up), 0.0F);
  EXPECT_EQ(middle(up), middle(down));
  options.signed_reflection = true;
  EXPECT_GT(middle(up), 0.0F);
  EXPECT_EQ(middle(up), -middle(down));
}

TEST(Simulation, WindowLimitsWhatIsSimulatedButNotWhatOccludes) {
  const CtVolume ct =
      ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return p.y() > 0.25 ? 900.0 : 100.0; });
  SimulationOptions options;
  options.window = HuWindow{-150.0, 400.0};
  EXPECT_NEAR(simulate(ct, downward_beams(kSize, 1, 1), options).gradient_hu_per_mm[kMiddle], 150.0,
              1e-3);
  options.occlusion.by_threshold = true;
  const SimulatedComponents s = simulate(ct, downward_beams(kSize, 1, 1), options);
  EXPECT_EQ(s.flags[kMiddle + 1], kOccluded);
  EXPECT_EQ(s.ct_hu[kMiddle + 1], 900.0F);
}

TEST(Simulation, TransmissionPerLengthDoesNotDependOnTheSampleSpacing) {
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) { return 20.0 * p.y(); });
  SimulationOptions options;
  options.transmission_length_mm = 1.0;
  BeamGrid coarse = downward_beams(31, 1, 1);
  BeamGrid fine = coarse;
  fine.axial = {121, 0.0, 0.25};
  const float of_coarse = simulate(ct, coarse, options).intensity.back();
  EXPECT_NEAR(simulate(ct, fine, options).intensity.back(), of_coarse, 2e-4);
  options.transmission_length_mm
      .reset();  // as printed: four times the samples, four times the loss
  EXPECT_GT(of_coarse - simulate(ct, fine, options).intensity.back(), 0.005F);
}

RC_GTEST_PROP(Simulation, MovingCtAndUltrasoundTogetherChangesNothing, ()) {
  const Grid grid = random_grid();
  CtVolume ct(grid);
  for (std::int16_t& voxel : ct.voxels) voxel = static_cast<std::int16_t>(integer(-1000, 1000));
  const ScanGeometry geometry = [] {
    ScanGeometry g;
    g.axial = {20, 0.0, 0.7};
    g.array = CurvilinearArray{12.0, uneven_table(5, -0.4, 0.4)};
    g.motion = MotorSweep{8.0, uneven_table(4, -0.3, 0.3), 0.0};
    return g;
  }();
  const BeamGrid beams = beam_grid(geometry);
  // Somewhere in the middle of the CT.
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
  T_ct_us.linear() = random_rotation();
  T_ct_us.translation() = grid.centre_mm() - T_ct_us.linear() * beams.point(2, 2, 10);
  SimulationOptions options;
  options.occlusion.by_threshold = *rc::gen::arbitrary<bool>();
  options.occlusion.bone_hu = 900.0;

  const Eigen::Isometry3d moved_by = random_pose();
  CtVolume moved = ct;
  moved.grid.origin_mm = moved_by * grid.origin_mm;
  moved.grid.direction = moved_by.linear() * grid.direction;
  BeamGrid moved_beams = beams;  // the US frame moves as well, by another motion
  const Eigen::Isometry3d us_moved_by = random_pose();
  for (Beam& beam : moved_beams.beams)
    beam = {us_moved_by * beam.origin_mm, us_moved_by.linear() * beam.direction};

  const SimulatedComponents a = simulate_components(beams, ct, T_ct_us, options);
  const SimulatedComponents b =
      simulate_components(moved_beams, moved, moved_by * T_ct_us * us_moved_by.inverse(), options);
  // A sample on the rim of the CT or of a threshold may round to either side; the rest of its beam
  // follows it.
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.count(); ++i)
    if (std::abs(a.ct_hu[i] - b.ct_hu[i]) > 0.02 || a.flags[i] != b.flags[i] ||
        std::abs(a.reflection[i] - b.reflection[i]) > 1e-3)
      ++different;
  RC_ASSERT(different <= a.count() / 50);
}

TEST(Simulation, SameBitsForAnyNumberOfThreads) {
  const CtVolume ct = ct_of(centred_grid(kSize, 1.0), [](const auto& p) {
    return 300.0 * std::sin(0.4 * p.x()) * std::cos(0.3 * p.y() + 0.2 * p.z());
  });
  const BeamGrid beams = downward_beams(40, 20, 15);
  const auto simulated = [&] { return simulate(ct, beams); };
  const SimulatedComponents one = with_threads(1, simulated);
  const SimulatedComponents three = with_threads(3, simulated);
  const auto fit = [&] { return fit_to_ultrasound(one, one.ct_hu, {}, {}); };
  const SimulatedUltrasound fit_one = with_threads(1, fit);
  const SimulatedUltrasound fit_three = with_threads(3, fit);
  EXPECT_EQ(one.reflection, three.reflection);
  EXPECT_EQ(one.intensity, three.intensity);
  EXPECT_EQ(fit_one.brightness, fit_three.brightness);
  EXPECT_EQ(fit_one.lc2, fit_three.lc2);
}

TEST(Simulation, RefusesWhatCannotBeSimulated) {
  const CtVolume ct = ct_of(centred_grid(5, 1.0), [](const auto&) { return 0.0; });
  const BeamGrid beams = downward_beams(5, 2, 2);
  const auto message = [&](const CtVolume& of_ct, const BeamGrid& of_beams,
                           const Eigen::Isometry3d& pose, const SimulationOptions& options) {
    try {
      simulate_components(of_beams, of_ct, pose, options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  Eigen::Isometry3d not_finite = kIdentity;
  not_finite.translation().x() = std::nan("");
  EXPECT_NE(message(ct, beams, not_finite, {}).find("T_ct_us"), std::string::npos);
  Eigen::Isometry3d scaled = kIdentity;
  scaled.linear() *= 1.1;
  EXPECT_NE(message(ct, beams, scaled, {}).find("T_ct_us"), std::string::npos);
  EXPECT_NE(message(CtVolume{}, beams, kIdentity, {}), "accepted");
  BeamGrid short_of_beams = beams;
  short_of_beams.beams.pop_back();
  EXPECT_NE(message(ct, short_of_beams, kIdentity, {}).find("beams"), std::string::npos);
  SimulationOptions options;
  options.mu_floor = 0.0;
  EXPECT_NE(message(ct, beams, kIdentity, options).find("'mu_floor' is 0, must be"),
            std::string::npos);
  options = {};
  options.window = HuWindow{400.0, -150.0};
  EXPECT_NE(message(ct, beams, kIdentity, options).find("low_hu"), std::string::npos);
}

}  // namespace
}  // namespace usct::test
