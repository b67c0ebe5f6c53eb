#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <atomic>
#include <functional>
#include <numeric>
#include <thread>

#include "core/similarity/patch_scenes.h"
#include "us_ct_registration/error.h"

namespace usct::test {
namespace {

/// Settings of all metrics together: `of` gives the options of one of them.
struct Settings : LocalLc2Options, JointCorrelationRatioOptions {
  PatchOptions patches;
  int bins = 32;

  SimilarityOptions of(const std::string& name) const {
    SimilarityOptions options = similarity_named(name, "test");
    std::visit([&](auto& metric) { set(metric); }, options);
    patches_of(options) = patches;
    return options;
  }

 private:
  void set(LocalLc2Options& o) const { o = *this; }
  void set(GlobalLc2Options& o) const { static_cast<Lc2Options&>(o) = *this; }
  void set(NccOptions& /*has none*/) const {}
  void set(MattesMiOptions& o) const { o.bins = bins; }
  void set(NmiOptions& o) const { o.bins = bins; }
  void set(CorrelationRatioOptions& o) const { o.bins = bins; }
  void set(JointCorrelationRatioOptions& o) const {
    o = *this;
    o.bins = bins;
  }
  void set(SimulatedLc2Options& /*not of patches*/) const {}
};

struct Case {
  BeamUltrasound us;
  Volume<float> ct;
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
  std::string metric = "local_lc2";
  Settings options;
  bool scalar = false;

  std::shared_ptr<const Similarity> similarity() const {
    return similarity_of(us, ct, options.of(metric), scalar ? scalar_backend() : simd_backend());
  }
  SimilarityValue value() const { return value_at(*similarity(), T_ct_us); }
};

std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const SimilarityOptions& options : all_metrics())
    names.emplace_back(similarity_name(options));
  return names;
}

/// Ultrasound that the CT explains in part, in patches of 3 mm.
Case make_case(const std::string& metric = "local_lc2") {
  Case c;
  c.us = noisy_ultrasound(downward_beams(25, 14, 9));
  c.ct = wavy_ct(oblique_grid({34, 36, 30}, {0.9, 1.1, 1.3}));
  c.metric = metric;
  c.options.patches = cubes(3.0);
  c.options.power = 2.0;
  std::size_t i = 0;
  for (int f = 0; f < 9; ++f)
    for (int l = 0; l < 14; ++l)
      for (int s = 0; s < 25; ++s, ++i) {
        const Seen seen = seen_at(c.us, s, l, f, c.ct, c.T_ct_us, GradientChannel::kMagnitude);
        c.us.brightness[i] += static_cast<float>(0.2 * seen.ct_hu + 0.2 * seen.gradient);
      }
  return c;
}

Case random_case() {
  Case c = make_case();
  const auto maybe = [] { return *rc::gen::arbitrary<bool>(); };
  c.T_ct_us = random_small_pose(1.0, 8.0);
  if (maybe())
    for (std::size_t i = 0; i < c.us.brightness.size(); ++i) c.us.known.push_back(hashed(i) > 9e3);
  c.options.channel = maybe() ? GradientChannel::kMagnitude : GradientChannel::kAlongBeam;
  c.options.patches = cubes(integer(2, 8));  // patches have up to several strands
  c.options.ridge_intensity_hu = maybe() ? 0.0 : uniform(1.0, 60.0);
  c.options.ridge_gradient_hu_per_mm = maybe() ? 0.0 : uniform(1.0, 60.0);
  c.options.positive_gradient = maybe();
  c.options.power = maybe() ? 1.0 : uniform(0.25, 4.0);
  c.options.weighting = static_cast<PatchWeighting>(integer(0, 3));
  c.options.pressed_mm = maybe() ? 0.0 : uniform(1.0, 200.0);
  c.scalar = maybe();
  c.options.bins = integer(8, 65);
  return c;
}

std::vector<std::vector<Seen>> seen_by(const Case& c) {
  return seen_by_patches(c.us, static_cast<int>(c.options.patches.depth_mm), c.ct, c.T_ct_us,
                         c.options.channel);
}

double mean_u(const std::vector<Seen>& samples) {
  double sum = 0.0;
  for (const Seen& s : samples) sum += s.u;
  return sum / static_cast<double>(samples.size());
}

double variance_u(const std::vector<Seen>& samples) {
  const double mean = mean_u(samples);
  double sum = 0.0;
  for (const Seen& s : samples) sum += (s.u - mean) * (s.u - mean);
  return sum / static_cast<double>(samples.size());
}

/// Dense least squares of u on m, g and 1, with rows of its own for the ridge.
double explained_by_least_squares(const std::vector<Seen>& samples, const Settings& o) {
  const auto n = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n + 2, 3);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(n + 2);
  const double mean = mean_u(samples);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Seen& s = samples[static_cast<std::size_t>(i)];
    A.row(i) << s.ct_hu - kBackgroundHu, s.gradient, 1.0;
    u[i] = s.u - mean;
  }
  A(n, 0) = std::sqrt(double(n)) * o.ridge_intensity_hu;
  A(n + 1, 1) = std::sqrt(double(n)) * o.ridge_gradient_hu_per_mm;
  Eigen::VectorXd w = A.completeOrthogonalDecomposition().solve(u);
  if (o.positive_gradient && w[1] < 0.0) {
    A.col(1).setZero();
    w = A.completeOrthogonalDecomposition().solve(u);
  }
  const double residual = (u.head(n) - A.topRows(n) * w).squaredNorm();
  return std::clamp(1.0 - residual / u.squaredNorm(), 0.0, 1.0);
}

double weight_of(const std::vector<Seen>& patch, const Settings& o) {
  const auto n = static_cast<double>(patch.size());
  const double exponent = 0.5 * static_cast<double>(o.weighting);
  double depth = 0.0;
  for (const Seen& s : patch) depth += s.depth_mm / n;
  const double trusted = 1.0 / (1.0 + std::pow(o.pressed_mm / depth, 2));
  return n * std::pow(variance_u(patch), exponent) * trusted;
}

double local_lc2_by_least_squares(const Case& c) {
  double sum = 0.0;
  double weights = 0.0;
  for (const auto& patch : seen_by(c)) {
    const double weight = weight_of(patch, c.options);
    sum += weight * std::pow(explained_by_least_squares(patch, c.options), c.options.power);
    weights += weight;
  }
  return sum / weights;
}

double share_inside(const std::vector<Seen>& samples) {
  double inside = 0.0;
  for (const Seen& s : samples) inside += s.inside ? 1.0 : 0.0;
  return inside / static_cast<double>(samples.size());
}

/// Samples on the borders of cells and of the CT may be rounded to either side.
constexpr double kTolerance = 2e-3;

RC_GTEST_PROP(PatchSimilarity, LocalLc2IsDenseLeastSquaresPerPatch, ()) {
  const Case c = random_case();
  const auto samples = all_of(seen_by(c));
  RC_PRE(share_inside(samples) > 0.0);
  const SimilarityValue value = c.value();
  // Without a ridge, rounding decides about patches of which only a corner lies in the CT.
  const bool free =
      c.options.ridge_intensity_hu == 0.0 || c.options.ridge_gradient_hu_per_mm == 0.0;
  RC_ASSERT(std::abs(value.value - local_lc2_by_least_squares(c)) <
            (free ? 5.0 : 1.0) * kTolerance);
  RC_ASSERT(std::abs(value.overlap - share_inside(samples)) < kTolerance);
}

TEST(PatchSimilarity, LocalLc2IsDenseLeastSquaresToFiveDigits) {
  for (const auto channel : {GradientChannel::kMagnitude, GradientChannel::kAlongBeam})
    for (const bool positive : {false, true})
      for (const double ridge : {0.0, 30.0})
        for (const double edge : {3.0, 7.0}) {
          Case c = make_case();
          c.T_ct_us = Eigen::Translation3d(1.234, -0.567, 0.891) *
                      Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized());
          c.options.channel = channel;
          c.options.positive_gradient = positive;
          c.options.ridge_intensity_hu = c.options.ridge_gradient_hu_per_mm = ridge;
          c.options.patches = cubes(edge);
          EXPECT_NEAR(c.value().value, local_lc2_by_least_squares(c), 1e-5)
              << static_cast<int>(channel) << positive << ridge << ' ' << edge;
        }
}

RC_GTEST_PROP(PatchSimilarity, GlobalLc2IsDenseLeastSquaresOverAllSamples, ()) {
  Case c = random_case();
  c.metric = "global_lc2";
  const auto samples = all_of(seen_by(c));
  RC_PRE(share_inside(samples) > 0.05);
  RC_ASSERT(std::abs(c.value().value - explained_by_least_squares(samples, c.options)) < 5e-4);
}

RC_GTEST_PROP(PatchSimilarity, NccIsTheCorrelationOverAllSamples, ()) {
  Case c = random_case();
  c.metric = "ncc";
  const auto samples = all_of(seen_by(c));
  RC_PRE(share_inside(samples) > 0.05);
  const double mean = mean_u(samples);
  double um = 0.0, m = 0.0, mm = 0.0;
  for (const Seen& s : samples) m += s.ct_hu / static_cast<double>(samples.size());
  for (const Seen& s : samples) {
    um += (s.u - mean) * (s.ct_hu - m);
    mm += (s.ct_hu - m) * (s.ct_hu - m);
  }
  const double uu = variance_u(samples) * static_cast<double>(samples.size());
  RC_ASSERT(std::abs(c.value().value - um / std::sqrt(uu * mm)) < 5e-4);
}

double spline(double x) {
  x = std::abs(x);
  if (x >= 2.0) return 0.0;
  return x < 1.0 ? (4.0 - 6.0 * x * x + 3.0 * x * x * x) / 6.0 : std::pow(2.0 - x, 3.0) / 6.0;
}

/// Joint probabilities as Mattes 2003 defines them: ultrasound x CT.
Eigen::MatrixXd joint_probabilities(const std::vector<Seen>& samples, int bins) {
  std::vector<double> sorted;
  sorted.reserve(samples.size());
  for (const Seen& s : samples) sorted.push_back(s.u);
  std::sort(sorted.begin(), sorted.end());
  const auto last = static_cast<double>(sorted.size() - 1);
  const double low = sorted[static_cast<std::size_t>(std::lround(0.005 * last))];
  const double high = sorted[static_cast<std::size_t>(std::lround(0.995 * last))];
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(bins, bins);
  for (const Seen& s : samples) {
    const int row =
        std::clamp(static_cast<int>(std::floor((s.u - low) / (high - low) * bins)), 0, bins - 1);
    const double at =
        2.0 + (s.ct_hu - kWindow.low_hu) / (kWindow.high_hu - kWindow.low_hu) * (bins - 4.0);
    for (int bin = 0; bin < bins; ++bin) p(row, bin) += spline(bin - at);
  }
  return p / static_cast<double>(samples.size());
}

double entropy(const Eigen::MatrixXd& p) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < p.size(); ++i)
    if (p(i) > 0.0) sum -= p(i) * std::log(p(i));
  return sum;
}

RC_GTEST_PROP(PatchSimilarity, MutualInformationIsThatOfTheHistogramByDefinition, ()) {
  Case c = random_case();
  const auto samples = all_of(seen_by(c));
  RC_PRE(share_inside(samples) > 0.05);
  const Eigen::MatrixXd p = joint_probabilities(samples, c.options.bins);
  double information = 0.0;  // Kullback-Leibler divergence
  for (Eigen::Index u = 0; u < p.rows(); ++u)
    for (Eigen::Index m = 0; m < p.cols(); ++m)
      if (p(u, m) > 0.0)
        information += p(u, m) * std::log(p(u, m) / (p.row(u).sum() * p.col(m).sum()));
  c.metric = "mattes_mi";
  RC_ASSERT(std::abs(c.value().value - information) < kTolerance);
  c.metric = "nmi";
  const double normalised = (entropy(p.rowwise().sum()) + entropy(p.colwise().sum())) / entropy(p);
  RC_ASSERT(std::abs(c.value().value - normalised) < kTolerance);
}

/// The CT sampled at its voxels' centres: sample (s, l, f) sees exactly voxel (l, s, f).
Case case_on_voxels(const std::string& metric) {
  Case c;
  c.us = noisy_ultrasound(downward_beams(24, 16, 16));
  Grid grid;
  grid.size = {17, 25, 17};
  grid.origin_mm = c.us.beams.point(0, 0, 0);
  c.ct = Volume<float>(grid, 0.0F);
  c.metric = metric;
  c.options.patches = PatchOptions::whole();
  return c;
}

template <typename Value>
void fill_on_voxels(Case& c, const Value& value) {
  for (int f = 0; f < 16; ++f)
    for (int l = 0; l < 16; ++l)
      for (int s = 0; s < 24; ++s) {
        const std::size_t i = offset_of(c.us.beams, s, l, f);
        const auto [u, hu] = value(i);
        c.us.brightness[i] = static_cast<float>(u);
        c.ct.at(l, s, f) = static_cast<float>(hu);
      }
}

TEST(PatchSimilarity, MutualInformationOfAKnownDistribution) {
  // P(bright | low CT) = 1/4, P(bright | high CT) = 3/4, both CT levels equally often and further
  // apart than the windows are wide.
  const double half = std::log(2.0);
  const double conditional = -(0.25 * std::log(0.25) + 0.75 * std::log(0.75));
  const auto fill = [](Case& c) {
    fill_on_voxels(c, [](std::size_t i) {
      const bool high = i % 2 == 0;
      const bool bright = high ? i / 2 % 4 != 0 : i / 2 % 4 == 0;
      return std::pair(bright ? 200.0 : 10.0, high ? 300.0 : -50.0);
    });
  };
  Case c = case_on_voxels("mattes_mi");
  fill(c);
  EXPECT_NEAR(c.value().value, half - conditional, 1e-6);
  EXPECT_EQ(c.value().overlap, 1.0);
  c = case_on_voxels("nmi");
  c.options.bins =
      30;  // the spline about each level has the same weights: its entropy counts twice
  fill(c);
  const double value = c.value().value;
  EXPECT_GT(value, 1.0);
  EXPECT_LT(value, (half + half) / (half + conditional));  // without the windows' entropy
}

TEST(PatchSimilarity, WhatIsIndependentSharesNoInformation) {
  for (const std::string kind : {"mattes_mi", "nmi", "correlation_ratio"}) {
    Case c = case_on_voxels(kind);
    fill_on_voxels(c, [](std::size_t i) {  // all combinations of 6 and 16 levels equally often
      return std::pair(10.0 * static_cast<double>(i % 6),
                       30.0 * static_cast<double>(i / 6 % 16) - 150);
    });
    const double none = kind == "nmi" ? 1.0 : 0.0;
    EXPECT_NEAR(c.value().value, none, 1e-6) << kind;
  }
}

TEST(PatchSimilarity, CorrelationRatioIsOneWhereTheCtSaysAll) {
  Case c = case_on_voxels("correlation_ratio");
  c.options.bins = 16;  // levels at their centres: 34 HU apart
  fill_on_voxels(c, [](std::size_t i) {
    const double level = std::floor(hashed(i) / 4096.0);
    return std::pair(30.0 * std::sin(2.5 * level), kWindow.low_hu + 34.0 * level);
  });
  EXPECT_NEAR(c.value().value, 1.0, 1e-6);
}

TEST(PatchSimilarity, CorrelationRatioIsTheVarianceOfConditionalMeans) {
  Case c = case_on_voxels("correlation_ratio");
  c.options.bins = 16;
  fill_on_voxels(c, [](std::size_t i) {  // +-10 explained by the CT, +-20 not explained
    return std::pair((i % 2 == 0 ? 10.0 : -10.0) + (i / 2 % 2 == 0 ? 20.0 : -20.0),
                     i % 2 == 0 ? 20.0 : 190.0);
  });
  EXPECT_NEAR(c.value().value, 100.0 / 500.0, 1e-6);
}

RC_GTEST_PROP(PatchSimilarity, JointCorrelationRatioIsThatOfItsKnotsByDefinition, ()) {
  Case c = random_case();
  c.metric = "joint_correlation_ratio";
  c.options.channel = GradientChannel::kMagnitude;
  c.options.gradient_bins = integer(2, 33);
  c.options.gradient_scale_hu_per_mm = uniform(5.0, 100.0);
  c.options.prior_samples =
      *rc::gen::element(0.0, 10.0);  // with 0, knots without samples are 0 / 0
  const auto samples = all_of(seen_by(c));
  RC_PRE(share_inside(samples) > 0.05);
  const double mean = mean_u(samples);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(c.options.bins, c.options.gradient_bins);
  Eigen::MatrixXd count = sum;
  const auto tent = [](double x) { return std::max(0.0, 1.0 - std::abs(x)); };
  for (const Seen& s : samples) {
    const double row = (s.ct_hu + 150.0) / 510.0 * (c.options.bins - 1);
    const double column = s.gradient / (s.gradient + c.options.gradient_scale_hu_per_mm) *
                          (c.options.gradient_bins - 1);
    for (Eigen::Index i = 0; i < sum.rows(); ++i)
      for (Eigen::Index j = 0; j < sum.cols(); ++j) {
        const double weight = tent(double(i) - row) * tent(double(j) - column);
        sum(i, j) += weight * (s.u - mean);
        count(i, j) += weight;
      }
  }
  const double explained =
      (sum.array().square() / (count.array() + c.options.prior_samples).max(1e-12)).sum();
  const double all = variance_u(samples) * static_cast<double>(samples.size());
  RC_ASSERT(std::abs(c.value().value - explained / all) < kTolerance);
}

TEST(PatchSimilarity, NoKindDependsOnGainAndOffset) {
  for (const std::string& kind : all_names()) {
    const Case c = make_case(kind);
    const double before = c.value().value;
    EXPECT_GT(before, 0.01) << kind;
    for (const float gain : {0.01F, 5.0F})
      for (const float offset : {-300.0F, 70.0F}) {
        Case changed = c;
        for (float& u : changed.us.brightness) u = gain * u + offset;
        const bool binned = kind == "mattes_mi" || kind == "nmi";
        EXPECT_NEAR(changed.value().value, before, binned ? 2e-3 : 2e-4)
            << kind << ' ' << gain << ' ' << offset;
      }
  }
}

TEST(PatchSimilarity, EveryKindIsHighestWhereTheUltrasoundBelongs) {
  for (const std::string& kind : all_names()) {
    const Case c = make_case(kind);
    const auto similarity = c.similarity();
    const double best = value_at(*similarity, c.T_ct_us).value;
    for (int axis = 0; axis < 3; ++axis)
      for (const double step : {-2.0, 2.0}) {
        Eigen::Isometry3d moved = c.T_ct_us;
        moved.translation()[axis] += step;
        EXPECT_LT(value_at(*similarity, moved).value, best) << kind << axis << step;
      }
  }
}

TEST(PatchSimilarity, NoTwoKindsAreTheSame) {
  std::vector<double> values;
  for (const std::string& kind : all_names()) {
    Case c = make_case(kind);
    c.options.power = 1.0;
    for (const double other : values) EXPECT_GT(std::abs(c.value().value - other), 1e-4);
    values.push_back(c.value().value);
  }
}

RC_GTEST_PROP(PatchSimilarity, PartsSumToTheValue, ()) {
  Case c = random_case();
  c.metric = all_names()[static_cast<std::size_t>(integer(0, 7))];
  RC_PRE(share_inside(all_of(seen_by(c))) > 0.05);
  const auto similarity = c.similarity();
  const AcquisitionErrors errors{uniform(-0.02, 0.02), uniform(-0.02, 0.02), uniform(-0.02, 0.02)};
  const std::vector<double> parts = similarity->parts({c.T_ct_us, errors});
  RC_ASSERT((parts.size() > 1) == (c.metric == "local_lc2"));
  RC_ASSERT(std::abs(std::accumulate(parts.begin(), parts.end(), 0.0) -
                     value_at(*similarity, c.T_ct_us, errors).value) < 1e-12);
}

TEST(PatchSimilarity, OverlapIsExactForABox) {
  // Beams from -7.5 to 7.5 in x, 24 samples in y, 16 frames in z; the CT's first and last voxels
  // lie half-way between samples.
  BeamUltrasound us = noisy_ultrasound(downward_beams(24, 16, 16));
  Grid grid;
  grid.size = {9, 13, 5};
  grid.origin_mm = us.beams.point(0, 0, 0) + Eigen::Vector3d(2.5, 3.5, 4.5);
  const Volume<float> ct = wavy_ct(grid);
  for (const std::string& kind : all_names()) {
    SimilarityOptions options = similarity_named(kind, "test");
    patches_of(options) = cubes(4.0);
    EXPECT_EQ(value_at(*similarity_of(us, ct, options), Eigen::Isometry3d::Identity()).overlap,
              8.0 * 12.0 * 4.0 / (24.0 * 16.0 * 16.0))
        << kind;
  }
}

TEST(PatchSimilarity, OutsideTheCtThereIsNoValue) {
  for (const std::string& kind : all_names())
    for (const bool scalar : {false, true}) {
      Case c = make_case(kind);
      c.scalar = scalar;
      c.T_ct_us.translation().x() = 500.0;
      const auto similarity = c.similarity();
      const SimilarityValue value = value_at(*similarity, c.T_ct_us);
      EXPECT_TRUE(std::isnan(value.value)) << kind;
      EXPECT_EQ(value.overlap, 0.0) << kind;
      for (const double part : similarity->parts({c.T_ct_us, {}})) EXPECT_TRUE(std::isnan(part));
    }
}

RC_GTEST_PROP(PatchSimilarity, MovingCtAndPoseTogetherChangesNothing, ()) {
  Case c = random_case();
  c.metric = all_names()[static_cast<std::size_t>(integer(0, 7))];
  c.options.ridge_intensity_hu = c.options.ridge_gradient_hu_per_mm = 20.0;
  RC_PRE(share_inside(all_of(seen_by(c))) > 0.05);
  const double before = c.value().value;
  const Eigen::Isometry3d moved = random_pose(100.0);
  c.ct.grid.direction = moved.linear() * c.ct.grid.direction;
  c.ct.grid.origin_mm = moved * c.ct.grid.origin_mm;
  c.T_ct_us = moved * c.T_ct_us;
  RC_ASSERT(std::abs(c.value().value - before) < kTolerance);
}

TEST(PatchSimilarity, AConstantCtExplainsNothing) {
  for (const double ridge : {0.0, 20.0})
    for (const std::string& kind : all_names()) {
      Case c = make_case(kind);
      std::fill(c.ct.voxels.begin(), c.ct.voxels.end(), 123.0F);
      c.ct.grid.spacing_mm.setConstant(3.0);
      c.ct.grid.origin_mm *= 3.0;  // nothing lies outside
      c.options.ridge_intensity_hu = c.options.ridge_gradient_hu_per_mm = ridge;
      EXPECT_NEAR(c.value().value, kind == "nmi" ? 1.0 : 0.0, 1e-6) << kind;
    }
}

TEST(PatchSimilarity, ErrorsOfDepthStretchTheBeams) {
  for (const double error : {-0.05, 0.02}) {
    Case c = make_case();
    c.T_ct_us = Eigen::Translation3d(1.234, -0.567, 0.891);
    Case stretched = c;
    stretched.us.beams.axial.start_depth_mm *= 1.0 + error;
    stretched.us.beams.axial.spacing_mm *= 1.0 + error;
    stretched.options.patches.depth_mm *= 1.0 + error;
    const double value = value_at(*c.similarity(), c.T_ct_us, {error, 0.0}).value;
    EXPECT_NEAR(value, stretched.value().value, 1e-5);
    EXPECT_GT(std::abs(value - c.value().value), 1e-3);
  }
}

TEST(PatchSimilarity, ErrorsOfTheSweepStretchIt) {
  for (const double error : {-0.2, 0.3}) {
    Case c = make_case();
    Case stretched = c;
    for (Beam& beam : stretched.us.beams.beams) beam.origin_mm.z() *= 1.0 + error;
    stretched.options.patches.elevation_mm *= 1.0 + error;
    const double value = value_at(*c.similarity(), c.T_ct_us, {0.0, error}).value;
    EXPECT_NEAR(value, stretched.value().value, 1e-5);
    EXPECT_GT(std::abs(value - c.value().value), 1e-3);
  }
}

TEST(PatchSimilarity, SameBitsFromSeveralThreads) {
  for (const std::string& kind : all_names()) {
    const Case c = make_case(kind);
    const auto similarity = c.similarity();
    const SimilarityValue expected = value_at(*similarity, c.T_ct_us);
    std::vector<SimilarityValue> values(6);
    std::vector<std::thread> threads;
    threads.reserve(values.size());
    for (SimilarityValue& value : values)
      threads.emplace_back([&] { value = value_at(*similarity, c.T_ct_us); });
    for (std::thread& thread : threads) thread.join();
    for (const SimilarityValue& value : values) {
      EXPECT_EQ(value.value, expected.value);
      EXPECT_EQ(value.overlap, expected.overlap);
    }
  }
}

TEST(PatchSimilarity, ABatchGivesWhatItsPosesGive) {
  for (const std::string& kind : all_names()) {
    const Case c = make_case(kind);
    const auto similarity = c.similarity();
    std::vector<SimilarityPose> poses;
    for (int i = 0; i < 40; ++i)
      poses.push_back({c.T_ct_us * Eigen::Translation3d(0.1 * i, 0.0, 0.0), {0.001 * i, 0.0}});
    const std::vector<SimilarityValue> values = similarity->evaluate(poses);
    ASSERT_EQ(values.size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const SimilarityValue alone = similarity->evaluate(poses[i]);
      EXPECT_EQ(values[i].value, alone.value) << kind << i;
      EXPECT_EQ(values[i].overlap, alone.overlap) << kind << i;
    }
    EXPECT_NE(values.front().value, values.back().value) << kind;
    EXPECT_TRUE(similarity->evaluate(std::vector<SimilarityPose>{}).empty());
  }
}

TEST(PatchSimilarity, ABatchEndsWhereTheCheckThrows) {
  struct Stop {};
  const Case c = make_case();
  const std::vector<SimilarityPose> poses(40, SimilarityPose{c.T_ct_us, {}});
  std::atomic<int> asked{0};
  const auto stop_at_the_fifth = [&] {
    if (++asked == 5) throw Stop{};
  };
  EXPECT_THROW(c.similarity()->evaluate(poses, stop_at_the_fifth), Stop);
  EXPECT_LT(asked, 40);
}

TEST(Catalogue, NamesAreRead) {
  EXPECT_EQ(similarity_names().size(), 8U);
  for (const std::string& name : similarity_names())
    EXPECT_EQ(similarity_name(similarity_named(name, "test")), name);
  EXPECT_THROW(similarity_named("mi", "test"), InputError);
}

TEST(Catalogue, MetricsSayWhatTheyNeed) {
  for (const std::string& name : similarity_names()) {
    const SimilarityNeeds needs = needs_of(similarity_named(name, "test"));
    EXPECT_NE(needs.patches, needs.recorded_ct) << name;
    EXPECT_FALSE(needs.beams) << name;
    EXPECT_TRUE(needs.follows_depth_error) << name;
    EXPECT_EQ(needs.follows_sweep_error, name != "simulated_lc2");
    if (needs.patches)
      EXPECT_EQ(needs.has_parts, !make_case(name).similarity()->part_centres_us_mm().empty())
          << name;
    else
      EXPECT_FALSE(needs.has_parts) << name;
  }
  LocalLc2Options along;
  along.channel = GradientChannel::kAlongBeam;
  EXPECT_TRUE(needs_of(along).beams);
}

TEST(Catalogue, AMetricTakesASubsetOfTheSamplesOfItsPatches) {
  for (SimilarityOptions options : all_metrics()) {
    patches_of(options) = cubes(5.0);
    SimilarityOptions same = on_samples(options, SampleSubset::kAll);
    EXPECT_EQ(patches_of(same), cubes(5.0)) << similarity_name(options);
    SimilarityOptions half = on_samples(options, SampleSubset::kHalf);
    PatchOptions expected = cubes(5.0);
    expected.samples = SampleSubset::kHalf;
    EXPECT_EQ(patches_of(half), expected) << similarity_name(options);
    // A similarity that takes half of the samples already takes no more.
    half = on_samples(half, SampleSubset::kAll);
    EXPECT_EQ(patches_of(half), expected) << similarity_name(options);
    SimilarityOptions quarter = on_samples(half, SampleSubset::kQuarter);
    expected.samples = SampleSubset::kQuarter;
    EXPECT_EQ(patches_of(quarter), expected) << similarity_name(options);
    quarter = on_samples(quarter, SampleSubset::kHalf);
    EXPECT_EQ(patches_of(quarter), expected) << similarity_name(options);
  }
  const SimilarityOptions simulated = SimulatedLc2Options{};
  EXPECT_EQ(on_samples(simulated, SampleSubset::kHalf).index(), simulated.index());
}

TEST(Catalogue, ACtThatIsMissingIsAnErrorOfTheProgram) {
  const Case c = make_case();
  const auto us = std::make_shared<const BeamUltrasound>(c.us);
  SimilarityImages images(us, nullptr, nullptr);
  EXPECT_THROW(make_similarity(images, c.options.of("ncc")), std::logic_error);
  EXPECT_THROW(make_similarity(images, SimulatedLc2Options{}), std::logic_error);
}

TEST(PatchSimilarity, RefusesOptionsThatAreWrong) {
  const auto refuse = [](const std::string& metric, const std::function<void(Case&)>& spoil) {
    Case c = make_case(metric);
    spoil(c);
    EXPECT_THROW(c.value(), InputError) << metric;
  };
  for (const char* metric : {"local_lc2", "global_lc2"}) {
    refuse(metric, [](Case& c) { c.options.ridge_intensity_hu = -1.0; });
    refuse(metric, [](Case& c) { c.options.ridge_gradient_hu_per_mm = std::nan(""); });
  }
  refuse("local_lc2", [](Case& c) { c.options.power = 0.1; });
  for (const char* metric : {"mattes_mi", "nmi", "correlation_ratio", "joint_correlation_ratio"}) {
    refuse(metric, [](Case& c) { c.options.bins = 7; });
    refuse(metric, [](Case& c) { c.options.bins = 129; });
  }
  refuse("joint_correlation_ratio", [](Case& c) { c.options.gradient_bins = 1; });
  refuse("joint_correlation_ratio", [](Case& c) { c.options.gradient_scale_hu_per_mm = 0.0; });
  refuse("joint_correlation_ratio", [](Case& c) { c.options.prior_samples = -1.0; });
}

TEST(PatchSimilarity, UltrasoundWithoutStructureHasNoSimilarity) {
  for (const std::string& kind : all_names()) {
    Case c = make_case(kind);
    c.us.brightness.assign(c.us.brightness.size(), 1.0F);
    EXPECT_EQ(c.similarity(), nullptr) << kind;
  }
}

}  // namespace
}  // namespace usct::test
