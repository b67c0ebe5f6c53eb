#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <unsupported/Eigen/AutoDiff>

#include "core/similarity/derivative_scenes.h"
#include "core/similarity/instructions.h"
#include "similarity/patch_derivatives.h"

namespace usct::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A number with its derivative by a translation.
using Auto = Eigen::AutoDiffScalar<Vector3d>;

/// A sample of a patch whose CT changes linearly with a translation.
struct Sample {
  double u = 0.0;
  Auto m, g;
};
using Samples = std::vector<Sample>;

/// The share that a fit with a ridge explains, by its definition: the normal equations of
/// deviations from the means, then the residual.
template <typename Number, typename Value>
Number share_by_definition(const Samples& samples, const Lc2Ridge& ridge, const Value& value_of) {
  const auto n = static_cast<double>(samples.size());
  double u_mean = 0.0;
  Number m_mean = value_of(samples[0].m) * 0.0;
  Number g_mean = m_mean;
  for (const Sample& s : samples) {
    u_mean += s.u / n;
    m_mean += value_of(s.m) / n;
    g_mean += value_of(s.g) / n;
  }
  Number mm = m_mean * 0.0 + n * ridge.intensity * ridge.intensity;
  Number gg = m_mean * 0.0 + n * ridge.gradient * ridge.gradient;
  Number mg = m_mean * 0.0;
  Number um = mg, ug = mg;
  double uu = 0.0;
  for (const Sample& s : samples) {
    const Number m = value_of(s.m) - m_mean;
    const Number g = value_of(s.g) - g_mean;
    const double u = s.u - u_mean;
    mm += m * m;
    gg += g * g;
    mg += m * g;
    um += u * m;
    ug += u * g;
    uu += u * u;
  }
  Number a = (gg * um - mg * ug) / (mm * gg - mg * mg);
  Number b = (mm * ug - mg * um) / (mm * gg - mg * mg);
  if (ridge.positive_gradient && b < 0.0) {
    a = um / mm;
    b = mg * 0.0;
  }
  Number residual = mg * 0.0;
  for (const Sample& s : samples) {
    const Number r = s.u - u_mean - a * (value_of(s.m) - m_mean) - b * (value_of(s.g) - g_mean);
    residual += r * r;
  }
  return 1.0 - residual / uu;
}

Auto share_with_derivative(const Samples& samples, const Lc2Ridge& ridge) {
  return share_by_definition<Auto>(samples, ridge, [](const Auto& x) { return x; });
}

double share_after(const Samples& samples, const Lc2Ridge& ridge, const Vector3d& translation) {
  return share_by_definition<double>(
      samples, ridge, [&](const Auto& x) { return x.value() + x.derivatives().dot(translation); });
}

/// The derivatives of one patch by the functions under test, with sums by their definition.
ShareDerivatives derivatives_of(const Samples& samples, const Lc2Ridge& ridge) {
  PatchMoments moments;
  moments.count = static_cast<double>(samples.size());
  double u_mean = 0.0;
  for (const Sample& s : samples) u_mean += s.u / moments.count;
  for (const Sample& s : samples) {
    const double u = s.u - u_mean, m = s.m.value(), g = s.g.value();
    moments.uu += u * u;
    moments.m += m;
    moments.g += g;
    moments.mm += m * m;
    moments.gg += g * g;
    moments.mg += m * g;
    moments.um += u * m;
    moments.ug += u * g;
  }
  const ShareSlopes slopes = share_slopes(moments, ridge);
  PatchDerivativeSums sums;
  for (const Sample& s : samples) {
    const double u = s.u - u_mean, m = s.m.value(), g = s.g.value();
    const Vector3d d = slopes.a * s.m.derivatives() + slopes.b * s.g.derivatives();
    sums.share +=
        (slopes.um * u + slopes.mm * m + slopes.mg * g + slopes.m_offset) * s.m.derivatives() +
        (slopes.ug * u + slopes.mg * m + slopes.gg * g + slopes.g_offset) * s.g.derivatives();
    sums.d += d;
    sums.dm += d * m;
    sums.dg += d * g;
    sums.dd += d * d.transpose();
  }
  return share_derivatives(moments, slopes, sums);
}

Vector3d random_slope() { return {uniform(-9, 9), uniform(-9, 9), uniform(-9, 9)}; }

Samples random_samples() {
  Samples samples;
  const double by_m = uniform(-2, 2), by_g = uniform(-2, 2);
  for (int i = integer(12, 60); i > 0; --i) {
    const double m = uniform(-50, 50), g = uniform(0, 40);
    samples.push_back(
        {by_m * m + by_g * g + uniform(-60, 60), Auto(m, random_slope()), Auto(g, random_slope())});
  }
  return samples;
}

Lc2Ridge random_ridge() {
  Lc2Ridge ridge{uniform(0.0, 20.0), uniform(0.0, 40.0), *rc::gen::arbitrary<bool>()};
  if (integer(0, 2) == 0) ridge.intensity = ridge.gradient = 0.0;
  return ridge;
}

RC_GTEST_PROP(PatchDerivatives, GradientIsThatOfAutomaticDifferentiation, ()) {
  const Samples samples = random_samples();
  const Lc2Ridge ridge = random_ridge();
  const Auto share = share_with_derivative(samples, ridge);
  const Vector3d gradient = derivatives_of(samples, ridge).gradient;
  RC_ASSERT((gradient - share.derivatives()).norm() <
            1e-4 * (share.derivatives().norm() + 1e-3));  // kLc2Floor is not in the definition
}

RC_GTEST_PROP(PatchDerivatives, GradientIsThatOfFiniteDifferences, ()) {
  const Samples samples = random_samples();
  Lc2Ridge ridge = random_ridge();
  ridge.positive_gradient = false;  // which has a kink
  const Vector3d gradient = derivatives_of(samples, ridge).gradient;
  constexpr double kStep = 1e-4;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStep * Vector3d::Unit(axis);
    const double slope =
        (share_after(samples, ridge, step) - share_after(samples, ridge, -step)) / (2.0 * kStep);
    RC_ASSERT(std::abs(gradient[axis] - slope) < 1e-4 * (gradient.norm() + 1e-3));
  }
}

/// Without the projection off what the weights take up, the curvature would be too large.
RC_GTEST_PROP(PatchDerivatives, CurvatureIsExactWithoutResidualAndRidge, ()) {
  Samples samples = random_samples();
  const double a = uniform(0.5, 2), b = uniform(0.5, 2);
  for (Sample& s : samples) s.u = a * s.m.value() + b * s.g.value() + 30.0;
  const Lc2Ridge ridge;
  const Matrix3d curvature = derivatives_of(samples, ridge).curvature;
  constexpr double kStep = 1e-3;
  const auto share = [&](const Vector3d& t) { return share_after(samples, ridge, t); };
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vector3d x = kStep * Vector3d::Unit(i), y = kStep * Vector3d::Unit(j);
      const double second =
          (share(x + y) - share(x - y) - share(y - x) + share(-x - y)) / (4.0 * kStep * kStep);
      RC_ASSERT(std::abs(curvature(i, j) + second) < 1e-3 * curvature.norm());
    }
}

RC_GTEST_PROP(PatchDerivatives, CurvatureIsPositiveSemidefinite, ()) {
  const Matrix3d curvature = derivatives_of(random_samples(), random_ridge()).curvature;
  const Vector3d direction = random_slope();
  RC_ASSERT(direction.dot(curvature * direction) >= -1e-12 * curvature.norm());
}

TEST(PatchDerivatives, APatchThatExplainsNothingHasNone) {
  PatchMoments moments;
  moments.count = 20.0;
  moments.uu = 100.0;
  const ShareSlopes slopes = share_slopes(moments, {});
  EXPECT_EQ(slopes.um, 0.0);
  EXPECT_TRUE(share_derivatives(moments, slopes, {}).curvature.isZero());
}

TEST(PackedGradient, OfARampIsItsSlopeInAllVoxels) {
  const Grid grid = oblique_grid({9, 8, 7}, {0.5, 1.0, 2.0});
  Volume<float> ramp(grid);
  const Vector3d steps(3, -2, 5);  // of a byte from voxel to voxel
  for (int k = 0; k < 7; ++k)
    for (int j = 0; j < 8; ++j)
      for (int i = 0; i < 9; ++i)
        ramp.at(i, j, k) = static_cast<float>(40.0 + 2.0 * steps.dot(Vector3d(i, j, k)));
  const PackedCt ct(ramp, kWindow, kBackgroundHu);
  const PackedGradient gradient = ct.gradient();
  const double slope = steps.cwiseQuotient(grid.spacing_mm).norm();
  for (std::size_t i = 0; i < ct.stride_k() * 7; ++i) {
    const std::uint32_t word = gradient.words[i];
    ASSERT_EQ(word & 0xFFFF, ct.pairs()[i]);
    for (const std::uint32_t byte : {word >> 16 & 0xFF, word >> 24})
      ASSERT_NEAR(byte * gradient.step_per_mm, slope, 0.5 * gradient.step_per_mm);
  }
}

/// Slopes on both sides of an edge: the mean of their squares counts.
TEST(PackedGradient, OfAnEdgeIsTheRootMeanSquareOfBothSides) {
  Volume<float> edge(oblique_grid({4, 4, 4}, {1.0, 1.0, 1.0}));
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) edge.at(i, j, k) = static_cast<float>(i < 2 ? 40.0 : 140.0);
  const PackedCt ct(edge, kWindow, kBackgroundHu);
  const auto at_edge = static_cast<std::uint32_t>(std::round(50.0 / std::sqrt(2.0)));
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(ct.gradient().words[i] >> 16 & 0xFF, i == 1 || i == 2 ? at_edge : 0) << i;
}

struct DerivativeScene {
  UltrasoundPatches us;
  PackedCt ct;
};

DerivativeScene random_derivative_scene() {
  BeamUltrasound us =
      noisy_ultrasound(downward_beams(integer(5, 40), integer(3, 20), integer(2, 9)));
  const PatchOptions patches{uniform(1.0, 9.0), uniform(1.0, 9.0), uniform(1.0, 9.0), 0.3,
                             SampleSubset::kAll};
  const Grid grid = oblique_grid({integer(10, 40), integer(10, 40), integer(10, 40)},
                                 {uniform(0.5, 1.5), uniform(0.5, 1.5), uniform(0.5, 1.5)});
  return {cut_into_patches(us, patches), PackedCt(wavy_ct(grid), kWindow, kBackgroundHu)};
}

StrandSlopes random_slopes() {
  StrandSlopes slopes{};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    ShareSlopes of;
    for (double* value :
         {&of.um, &of.ug, &of.mm, &of.mg, &of.gg, &of.m_offset, &of.g_offset, &of.a, &of.b})
      *value = uniform(-1.0, 1.0);
    slopes.set(lane, of);
  }
  return slopes;
}

/// The largest difference of two sums of a strand, as a share of what its samples may contribute.
double difference(const DerivativeSums& a, const DerivativeSums& b, std::size_t lane, double rows) {
  constexpr double kValue = 300.0, kSlope = 100.0;  // of m and g, and of their derivatives
  double most = 0.0;
  const auto compare = [&](float x, float y, double size) {
    most = std::max(most, std::abs(static_cast<double>(x) - static_cast<double>(y)) / size);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    compare(a.share[axis][lane], b.share[axis][lane], rows * kValue * kSlope);
    compare(a.d[axis][lane], b.d[axis][lane], rows * kSlope);
    compare(a.dm[axis][lane], b.dm[axis][lane], rows * kValue * kSlope);
    compare(a.dg[axis][lane], b.dg[axis][lane], rows * kValue * kSlope);
  }
  for (std::size_t i = 0; i < 6; ++i) compare(a.dd[i][lane], b.dd[i][lane], rows * kSlope * kSlope);
  return most;
}

RC_GTEST_PROP(PatchDerivatives, SumsAreTheReferenceWithAllInstructions, ()) {
  const DerivativeScene scene = random_derivative_scene();
  RC_PRE(!scene.us.patches.empty());
  AcquisitionErrors errors;
  if (*rc::gen::arbitrary<bool>())
    errors = {uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1)};
  const SimilarityPose pose{random_small_pose(3.0, 10.0), errors};
  const PatchKernelInput input =
      kernel_input(scene.us, scene.ct, pose, GradientChannel::kMagnitude);
  const auto samples = std::make_unique<BlockSamples>();
  for (std::size_t b = 0; b < scene.us.blocks.size(); ++b) {
    const StrandSlopes slopes = random_slopes();
    StrandSums expected_values;
    DerivativeSums expected;
    sample_derivatives_scalar(input, b, *samples, expected_values);
    sum_derivatives_scalar(scene.us, b, *samples, slopes, DerivativeOrder::kCurvature, expected);
    for (const std::int64_t target : Instructions::all()) {
      const Instructions instructions(target);
      StrandSums values, values_alone;
      DerivativeSums sums, gradient_alone;
      sample_derivatives_simd(input, b, *samples, values);
      sum_derivatives_simd(scene.us, b, *samples, slopes, DerivativeOrder::kCurvature, sums);
      sum_derivatives_simd(scene.us, b, *samples, slopes, DerivativeOrder::kGradient,
                           gradient_alone);
      sum_strands_simd(input, b, b + 1, &values_alone);
      int differ = 0;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto rows = static_cast<double>(scene.us.blocks[b].rows);
        differ += difference(sums, expected, lane, rows) > 1e-4 ? 1 : 0;
        RC_ASSERT(values.um[lane] == values_alone.um[lane]);
        RC_ASSERT(values.gg[lane] == values_alone.gg[lane]);
        RC_ASSERT(gradient_alone.share[1][lane] == sums.share[1][lane]);
      }
      RC_ASSERT(differ <= 1);  // a sample on the border of a cell may be rounded into either
    }
  }
}

/// A scene that local LC2 registers.
struct RegistrableByLc2 : Registrable {
  LocalLc2Options options;
  RegistrableByLc2() { options.patches = cubes(4.0); }
};

TEST(LocalLc2Derivatives, AreTheSlopesOfTheValue) {
  const RegistrableByLc2 scene;
  for (const AcquisitionErrors& errors :
       {AcquisitionErrors{}, AcquisitionErrors{0.02, -0.03, 0.04}})
    expect_slopes(*similarity_of(scene.us, scene.ct, scene.options), near_pose(errors));
}

/// With a ridge, stretched ultrasound has another similarity in each patch by itself, since slopes
/// of the CT become steeper or flatter; the derivatives take patches as rigid.
TEST(LocalLc2Derivatives, ByErrorsAreTheSlopesWithoutARidge) {
  RegistrableByLc2 scene;
  scene.options.ridge_intensity_hu = scene.options.ridge_gradient_hu_per_mm = 0.0;
  const auto similarity = similarity_of(scene.us, scene.ct, scene.options);
  EXPECT_TRUE(similarity->has_error_derivatives());
  for (const AcquisitionErrors& errors :
       {AcquisitionErrors{}, AcquisitionErrors{0.02, -0.03, 0.04}})
    expect_slopes(*similarity, near_pose(errors), SimilarityDerivatives::kCount);
}

TEST(LocalLc2Derivatives, ByErrorsNeedBeams) {
  const RegistrableByLc2 scene;
  SimilarityImages images(std::make_shared<const BeamUltrasound>(scene.us),
                          pack_ct(scene.ct, kWindow, kBackgroundHu), nullptr, false);
  const auto similarity = make_similarity(images, scene.options);
  EXPECT_FALSE(similarity->has_error_derivatives());
  const auto derivatives = similarity->derivatives(near_pose({}), DerivativeOrder::kCurvature);
  const auto with_beams = similarity_of(scene.us, scene.ct, scene.options)
                              ->derivatives(near_pose({}), DerivativeOrder::kCurvature);
  EXPECT_TRUE(derivatives->gradient.tail<3>().isZero(0.0));
  EXPECT_TRUE(derivatives->curvature.bottomRows<3>().isZero(0.0));
  EXPECT_EQ(derivatives->gradient.head<6>(), with_beams->gradient.head<6>());
}

TEST(LocalLc2Derivatives, FollowWeightsPowerAndLongPatches) {
  RegistrableByLc2 scene;
  scene.options.power = 2.0;
  scene.options.pressed_mm = 30.0;
  scene.options.weighting = PatchWeighting::kVariance;
  scene.options.patches = cubes(6.0);  // several strands a patch
  expect_slopes(*similarity_of(scene.us, scene.ct, scene.options), near_pose({}));
}

TEST(LocalLc2Derivatives, OfMirroredUltrasoundAreTheSlopesOfItsValue) {
  const RegistrableByLc2 scene;
  const auto similarity = similarity_of(scene.us, scene.ct, scene.options);
  expect_slopes_of_mirrored(*similarity);
}

TEST(LocalLc2Derivatives, AreTheReferenceToRounding) {
  const RegistrableByLc2 scene;
  const auto by = [&](const SimilarityBackend& backend) {
    return *similarity_of(scene.us, scene.ct, scene.options, backend)
                ->derivatives(near_pose({}), DerivativeOrder::kCurvature);
  };
  const SimilarityDerivatives simd = by(simd_backend()), scalar = by(scalar_backend());
  EXPECT_LT((simd.gradient - scalar.gradient).norm(), 1e-3 * scalar.gradient.norm());
  EXPECT_LT((simd.curvature - scalar.curvature).norm(), 1e-3 * scalar.curvature.norm());
}

TEST(LocalLc2Derivatives, BelongToTheMagnitudeAlone) {
  RegistrableByLc2 scene;
  EXPECT_TRUE(scene.options.needs().has_derivatives);
  scene.options.channel = GradientChannel::kAlongBeam;
  EXPECT_FALSE(scene.options.needs().has_derivatives);
  EXPECT_FALSE(similarity_of(scene.us, scene.ct, scene.options)
                   ->derivatives(near_pose({}), DerivativeOrder::kGradient));
}

TEST(LocalLc2Derivatives, HaveNoValueWithoutOverlap) {
  const RegistrableByLc2 scene;
  SimilarityPose far;
  far.T_ct_us.translation().x() = 500.0;
  const auto derivatives = similarity_of(scene.us, scene.ct, scene.options)
                               ->derivatives(far, DerivativeOrder::kCurvature);
  EXPECT_TRUE(std::isnan(derivatives->value.value));
}

}  // namespace
}  // namespace usct::test
