#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/similarity/derivative_scenes.h"
#include "core/similarity/instructions.h"
#include "similarity/joint_derivatives.h"

namespace usct::test {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Ultrasound in a CT, and a function at the knots.
struct JointScene {
  UltrasoundPatches us = cut_into_patches(
      noisy_ultrasound(downward_beams(integer(5, 40), integer(3, 20), integer(2, 9))),
      {uniform(1.0, 9.0), uniform(1.0, 9.0), uniform(1.0, 9.0), 0.3, SampleSubset::kAll});
  PackedCt ct{wavy_ct(oblique_grid({integer(10, 40), integer(10, 40), integer(10, 40)},
                                   {uniform(0.5, 1.5), uniform(0.5, 1.5), uniform(0.5, 1.5)})),
              kWindow, kBackgroundHu};
  std::vector<float> ultrasound{us.value.begin(), us.value.end()};
  std::vector<float> function;
  int rows = integer(8, 30), columns = integer(2, 12);
  double scale = uniform(5.0, 100.0);

  JointScene() {
    for (std::size_t place = 0; place < ultrasound.size(); ++place)
      if (us.x_mm[place] == UltrasoundPatches::kNowhere) ultrasound[place] = std::nanf("");
    for (int knot = 0; knot < rows * columns; ++knot)
      function.push_back(static_cast<float>(uniform(-50.0, 50.0)));
  }

  JointDerivativesInput input(const SimilarityPose& pose) const {
    return {{kernel_input(us, ct, pose, GradientChannel::kMagnitude), ultrasound.data(), rows,
             columns, scale},
            function.data()};
  }
};

/// The sums over knots that the value is made of, by their definition: sum of (2 f u - f^2) w, and
/// the function at each sample, after a motion of all samples of a block that changes CT value and
/// gradient linearly. Shares are those of the four knots around the sample before it moved, since
/// the position between knots has a kink at the knots.
struct ByDefinition {
  double value = 0.0;
  std::vector<double> function;
};

/// Position between the knots: row and column.
Eigen::Vector2d position_of(const JointSumsInput& in, double m, double g) {
  const PackedCt& ct = in.samples.ct;
  const double scale = in.gradient_scale_hu_per_mm / ct.step_hu();
  return {(m + ct.background()) / 255.0 * (in.rows - 1), g / (g + scale) * (in.columns - 1)};
}

ByDefinition after(const JointDerivativesInput& in, std::size_t block, const BlockSamples& samples,
                   const Vector6& motion) {
  const UltrasoundPatches& us = in.sums.samples.us;
  ByDefinition result;
  for (std::size_t i = 0; i < us.blocks[block].rows * kLanes; ++i) {
    const std::size_t s = us.blocks[block].begin + i;
    if (std::isnan(in.sums.ultrasound[s])) continue;
    const BlockSamples::Row& row = samples.rows[i / kLanes];
    const std::size_t lane = i % kLanes;
    const Eigen::Vector3d at(us.x_mm[s], us.y_mm[s], us.z_mm[s]);
    const Eigen::Vector3d voxels =
        in.sums.samples.T_index_us.linear() * (motion.head<3>().cross(at) + motion.tail<3>());
    double m = row.m[lane], g = row.g[lane];
    const Eigen::Vector2d before = position_of(in.sums, m, g);
    for (int axis = 0; axis < 3; ++axis) {
      m += voxels[axis] * row.by_m[axis][lane];
      g += voxels[axis] * row.by_g[axis][lane];
    }
    const Eigen::Vector2d moved = position_of(in.sums, m, g);
    const int r = std::min(static_cast<int>(before[0]), in.sums.rows - 2);
    const int c = std::min(static_cast<int>(before[1]), in.sums.columns - 2);
    double function = 0.0;
    for (int dr = 0; dr < 2; ++dr)
      for (int dc = 0; dc < 2; ++dc) {
        const double share = (dr == 0 ? 1.0 - (moved[0] - r) : moved[0] - r) *
                             (dc == 0 ? 1.0 - (moved[1] - c) : moved[1] - c);
        const double f = in.function[(r + dr) * in.sums.columns + c + dc];
        function += share * f;
        result.value += share * f * (2.0 * in.sums.ultrasound[s] - f);
      }
    result.function.push_back(function);
  }
  return result;
}

/// Whether the position is so near an inner knot that rounding decides on the side, and thereby on
/// the slope.
bool is_at_knot(double position, int knots) {
  const double nearest = std::round(position);
  return std::abs(position - nearest) < 1e-4 && nearest > 0.5 && nearest < knots - 1.5;
}

/// Moves what was sampled at a knot away from it, since the slope there depends on the rounding.
void move_off_knots(const JointDerivativesInput& in, BlockSamples& samples) {
  for (BlockSamples::Row& row : samples.rows)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Eigen::Vector2d at = position_of(in.sums, row.m[lane], row.g[lane]);
      if (is_at_knot(at[0], in.sums.rows)) row.m[lane] += 0.01F;
      if (is_at_knot(at[1], in.sums.columns)) row.g[lane] *= 1.01F;
    }
}

RC_GTEST_PROP(JointDerivatives, AreDifferencesOfTheDefinition, ()) {
  const JointScene scene;
  RC_PRE(!scene.us.patches.empty());
  const JointDerivativesInput in = scene.input({random_small_pose(3.0, 10.0), {}});
  const auto samples = std::make_unique<BlockSamples>();
  StrandSums unused;
  sample_derivatives_scalar(in.sums.samples, 0, *samples, unused);
  JointDerivatives sums;
  add_joint_derivatives_scalar(in, 0, *samples, DerivativeOrder::kCurvature, sums);
  constexpr double kStep = 1e-6;
  std::vector<std::vector<double>> changes;
  Vector6 slopes;
  for (int p = 0; p < 6; ++p) {
    const Vector6 step = kStep * Vector6::Unit(p);
    const ByDefinition plus = after(in, 0, *samples, step), minus = after(in, 0, *samples, -step);
    slopes[p] = (plus.value - minus.value) / (2.0 * kStep);
    changes.emplace_back();
    for (std::size_t i = 0; i < plus.function.size(); ++i)
      changes.back().push_back((plus.function[i] - minus.function[i]) / (2.0 * kStep));
  }
  const Vector6 value = Eigen::Map<const Vector6>(sums.value);
  RC_ASSERT((value - slopes).norm() < 1e-3 * slopes.norm() + 0.1);
  std::size_t at = 0;
  for (int p = 0; p < 6; ++p)
    for (int q = 0; q <= p; ++q, ++at) {
      double product = 0.0, size = 0.0;
      for (std::size_t i = 0; i < changes[0].size(); ++i) {
        const auto row = static_cast<std::size_t>(p), column = static_cast<std::size_t>(q);
        product += changes[row][i] * changes[column][i];
        size += std::abs(changes[row][i] * changes[column][i]);
      }
      RC_ASSERT(std::abs(sums.function[at] - product) < 1e-3 * size + 0.1);
    }
}

RC_GTEST_PROP(JointDerivatives, AreTheReferenceWithAllInstructions, ()) {
  const JointScene scene;
  RC_PRE(!scene.us.patches.empty());
  AcquisitionErrors errors;
  if (*rc::gen::arbitrary<bool>())
    errors = {uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1)};
  const JointDerivativesInput in = scene.input({random_small_pose(3.0, 10.0), errors});
  const auto samples = std::make_unique<BlockSamples>();
  StrandSums unused;
  for (std::size_t block = 0; block < scene.us.blocks.size(); ++block) {
    sample_derivatives_scalar(in.sums.samples, block, *samples, unused);
    move_off_knots(in, *samples);
    JointDerivatives expected;
    add_joint_derivatives_scalar(in, block, *samples, DerivativeOrder::kCurvature, expected);
    double value_size = 1.0, function_size = 1.0;
    for (const double v : expected.value) value_size = std::max(value_size, std::abs(v));
    for (const double f : expected.function) function_size = std::max(function_size, std::abs(f));
    for (const std::int64_t target : Instructions::all()) {
      const Instructions instructions(target);
      JointDerivatives sums, gradient_alone;
      add_joint_derivatives_simd(in, block, *samples, DerivativeOrder::kCurvature, sums);
      add_joint_derivatives_simd(in, block, *samples, DerivativeOrder::kGradient, gradient_alone);
      for (std::size_t p = 0; p < 6; ++p) {
        RC_ASSERT(std::abs(sums.value[p] - expected.value[p]) < 1e-3 * value_size);
        RC_ASSERT(gradient_alone.value[p] == sums.value[p]);
      }
      for (std::size_t i = 0; i < JointDerivatives::kProducts; ++i)
        RC_ASSERT(std::abs(sums.function[i] - expected.function[i]) < 1e-3 * function_size);
      RC_ASSERT(gradient_alone.function[0] == 0.0);
    }
  }
}

JointCorrelationRatioOptions joint_options() {
  JointCorrelationRatioOptions options;
  options.patches = cubes(8.0);
  return options;
}

TEST(JointCorrelationRatioDerivatives, AreTheSlopesOfTheValue) {
  const Registrable scene;
  for (const AcquisitionErrors& errors :
       {AcquisitionErrors{}, AcquisitionErrors{0.02, -0.03, 0.04}})
    expect_slopes(*similarity_of(scene.us, scene.ct, joint_options()), near_pose(errors));
}

TEST(JointCorrelationRatioDerivatives, OfMirroredUltrasoundAreTheSlopesOfItsValue) {
  const Registrable scene;
  const auto similarity = similarity_of(scene.us, scene.ct, joint_options());
  expect_slopes_of_mirrored(*similarity);
}

TEST(JointCorrelationRatioDerivatives, AreTheReferenceToRounding) {
  const Registrable scene;
  const auto by = [&](const SimilarityBackend& backend) {
    return *similarity_of(scene.us, scene.ct, joint_options(), backend)
                ->derivatives(near_pose({}), DerivativeOrder::kCurvature);
  };
  const SimilarityDerivatives simd = by(simd_backend()), scalar = by(scalar_backend());
  EXPECT_LT((simd.gradient - scalar.gradient).norm(), 1e-3 * scalar.gradient.norm());
  EXPECT_LT((simd.curvature - scalar.curvature).norm(), 1e-3 * scalar.curvature.norm());
}

TEST(JointCorrelationRatioDerivatives, AreSparedWhereTheValueIsNotAboveWhatIsWanted) {
  const Registrable scene;
  const auto similarity = similarity_of(scene.us, scene.ct, joint_options());
  const SimilarityPose pose = near_pose({});
  const double value = similarity->evaluate(pose).value;
  const auto wanted_above = [&](double above) {
    return *similarity->derivatives(pose, DerivativeOrder::kGradient, above);
  };
  EXPECT_EQ(wanted_above(value).value.value, value);
  EXPECT_TRUE(wanted_above(value).only_value);
  EXPECT_FALSE(wanted_above(std::nextafter(value, 0.0)).only_value);
  EXPECT_EQ(wanted_above(std::nextafter(value, 0.0)).gradient,
            similarity->derivatives(pose, DerivativeOrder::kGradient)->gradient);
}

TEST(JointCorrelationRatioDerivatives, HaveNoValueWithoutOverlap) {
  const Registrable scene;
  SimilarityPose far;
  far.T_ct_us.translation().x() = 500.0;
  const auto derivatives = similarity_of(scene.us, scene.ct, joint_options())
                               ->derivatives(far, DerivativeOrder::kCurvature);
  EXPECT_TRUE(std::isnan(derivatives->value.value));
}

}  // namespace
}  // namespace usct::test
