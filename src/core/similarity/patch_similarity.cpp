#include "us_ct_registration/similarity/patch_similarity.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "similarity/joint_sums.h"
#include "similarity/patch_sums.h"
#include "simulation/require.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr std::array<const char*, 8> kKindNames = {"local_lc2",
                                                   "global_lc2",
                                                   "ncc",
                                                   "mattes_mi",
                                                   "nmi",
                                                   "correlation_ratio",
                                                   "joint_correlation_ratio",
                                                   "simulated_lc2"};

/// Central second moments of ultrasound u, CT value m (HU) and gradient g (HU/mm), not divided by
/// the count.
struct Moments {
  double count = 0.0;
  double uu = 0.0;
  double mm = 0.0;
  double gg = 0.0;
  double mg = 0.0;
  double um = 0.0;
  double ug = 0.0;
};

/// Share of the ultrasound's variance that a * m + b * g explains, with weights (a, b) that
/// minimise the residual plus n (ridge_m a)^2 + n (ridge_g b)^2.
double explained_share(const Moments& s, const SimilarityOptions& options) {
  const double ridge_m = options.ridge_intensity_hu;
  const double ridge_g = options.ridge_gradient_hu_per_mm;
  // The floor is so small beside the moments that it decides nothing but 0 / 0.
  constexpr double kTiny = 1e-9;
  const double mm = (1.0 + kTiny) * s.mm + s.count * ridge_m * ridge_m;
  const double gg = (1.0 + kTiny) * s.gg + s.count * ridge_g * ridge_g;
  const double determinant = mm * gg - s.mg * s.mg;
  double a = 0.0;
  double b = 0.0;
  if (determinant > 0.0) {
    a = (gg * s.um - s.mg * s.ug) / determinant;
    b = (mm * s.ug - s.mg * s.um) / determinant;
  }
  if (!(determinant > 0.0) || (options.positive_gradient && b < 0.0)) {
    a = mm > 0.0 ? s.um / mm : 0.0;
    b = 0.0;
  }
  const double explained =
      2.0 * (a * s.um + b * s.ug) - (a * a * s.mm + 2.0 * a * b * s.mg + b * b * s.gg);
  return s.uu > 0.0 ? std::clamp(explained / s.uu, 0.0, 1.0) : 0.0;
}

class PatchSimilarity : public Similarity {
 public:
  PatchSimilarity(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
                  const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options) {
    for (const UltrasoundPatches::Patch& patch : us_->patches) {
      const auto count = static_cast<double>(patch.count);
      const double deviation = std::sqrt(patch.square_sum / count);
      const double power = options_.weighting == PatchWeighting::kCount ? 1.0
                           : options_.weighting == PatchWeighting::kDeviation
                               ? deviation
                               : deviation * deviation;
      weights_.push_back(count * power);
    }
    double sum = 0.0;
    for (const double weight : weights_) sum += weight;
    for (double& weight : weights_) weight /= sum;

    const auto n = static_cast<double>(us_->count);
    for (const UltrasoundPatches::Patch& patch : us_->patches)
      mean_ += static_cast<double>(patch.count) * patch.mean / n;
    for (const UltrasoundPatches::Patch& patch : us_->patches)
      square_sum_ += patch.square_sum +
                     static_cast<double>(patch.count) * (patch.mean - mean_) * (patch.mean - mean_);
  }

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    if (options_.kind == SimilarityKind::kJointCorrelationRatio)
      return joint_correlation_ratio(T_ct_us, errors);
    const std::vector<PatchSums> sums = sums_at(T_ct_us, errors);
    SimilarityValue result;
    for (const PatchSums& patch : sums) result.overlap += static_cast<double>(patch.inside);
    result.overlap /= static_cast<double>(us_->count);
    if (result.overlap > 0.0) result.value = value_of(sums);
    return result;
  }

  std::vector<double> parts(const Eigen::Isometry3d& T_ct_us,
                            const AcquisitionErrors& errors) const override {
    if (options_.kind != SimilarityKind::kLocalLc2) return {evaluate(T_ct_us, errors).value};
    const std::vector<PatchSums> sums = sums_at(T_ct_us, errors);
    std::vector<double> result(sums.size());
    for (std::size_t p = 0; p < sums.size(); ++p) result[p] = weights_[p] * local_lc2(sums, p);
    return result;
  }

 private:
  /// Where the samples are, for acquisition errors that are not 0; `moved` keeps them.
  std::array<const float*, 3> positions(const AcquisitionErrors& errors,
                                        std::array<std::vector<float>, 3>& moved) const {
    if (errors.depth == 0.0 && errors.sweep == 0.0)
      return {us_->x_mm.data(), us_->y_mm.data(), us_->z_mm.data()};
    moved = moved_samples(errors);
    return {moved[0].data(), moved[1].data(), moved[2].data()};
  }

  std::vector<PatchSums> sums_at(const Eigen::Isometry3d& T_ct_us,
                                 const AcquisitionErrors& errors) const {
    std::array<std::vector<float>, 3> moved;
    const auto [x, y, z] = positions(errors, moved);
    const PatchSumsInput input{
        *ct_, *us_, x, y, z, ct_->grid().T_index_physical() * T_ct_us, options_.channel};
    std::vector<PatchSums> sums(us_->patches.size());
    (options_.scalar ? sum_patches_scalar : sum_patches_simd)(input, sums.data());
    return sums;
  }

  SimilarityValue joint_correlation_ratio(const Eigen::Isometry3d& T_ct_us,
                                          const AcquisitionErrors& errors) const {
    std::array<std::vector<float>, 3> moved;
    const auto [x, y, z] = positions(errors, moved);
    const JointSumsInput input{*ct_,
                               *us_,
                               x,
                               y,
                               z,
                               ct_->grid().T_index_physical() * T_ct_us,
                               options_.bins,
                               options_.gradient_bins,
                               options_.gradient_scale_hu_per_mm};
    const JointSums sums = (options_.scalar ? joint_sums_scalar : joint_sums_simd)(input);
    SimilarityValue result;
    result.overlap = sums.inside / static_cast<double>(us_->count);
    if (!(sums.inside > 0.0)) return result;
    // A knot that few samples share explains them by chance: it is held to the mean of all.
    constexpr double kPriorSamples = 10.0;
    double explained = 0.0;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot) {
      const double difference = sums.ultrasound[knot] - mean_ * sums.count[knot];
      explained += difference * difference / (sums.count[knot] + kPriorSamples);
    }
    result.value = explained / square_sum_;
    return result;
  }

  std::array<std::vector<float>, 3> moved_samples(const AcquisitionErrors& errors) const {
    const auto along = static_cast<float>(1.0 / (1.0 + errors.depth) - 1.0);
    const auto sweep = static_cast<float>(errors.sweep);
    const std::array<const std::vector<float>*, 3> from = {&us_->x_mm, &us_->y_mm, &us_->z_mm};
    const std::array<const std::vector<float>*, 3> direction = {
        &us_->direction_x, &us_->direction_y, &us_->direction_z};
    const std::array<const std::vector<float>*, 3> motion = {&us_->sweep_x, &us_->sweep_y,
                                                             &us_->sweep_z};
    std::array<std::vector<float>, 3> moved;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      moved[axis].resize(us_->value.size());
      const float* p = from[axis]->data();
      const float* d = direction[axis]->data();
      const float* m = motion[axis]->data();
      for (std::size_t s = 0; s < moved[axis].size(); ++s)
        moved[axis][s] = p[s] + along * us_->depth_mm[s] * d[s] + sweep * m[s];
    }
    return moved;
  }

  double value_of(const std::vector<PatchSums>& sums) const {
    if (options_.kind == SimilarityKind::kLocalLc2) {
      double value = 0.0;
      for (std::size_t p = 0; p < sums.size(); ++p) value += weights_[p] * local_lc2(sums, p);
      return value;
    }
    const Moments all = global_moments(sums);
    if (options_.kind == SimilarityKind::kGlobalLc2) return explained_share(all, options_);
    return all.mm > 0.0 ? all.um / std::sqrt(all.uu * all.mm) : 0.0;
  }

  double local_lc2(const std::vector<PatchSums>& sums, std::size_t p) const {
    const PatchSums& sum = sums[p];
    const auto n = static_cast<double>(us_->patches[p].count);
    const double hu = ct_->step_hu();
    const double m = sum.m;
    const double g = sum.g;
    const Moments moments{n,
                          us_->patches[p].square_sum,
                          hu * hu * (sum.mm - m * m / n),
                          hu * hu * (sum.gg - g * g / n),
                          hu * hu * (sum.mg - m * g / n),
                          hu * sum.um,
                          hu * sum.ug};
    return std::pow(explained_share(moments, options_), options_.power);
  }

  Moments global_moments(const std::vector<PatchSums>& sums) const {
    const auto n = static_cast<double>(us_->count);
    const double hu = ct_->step_hu();
    double u = 0.0, m = 0.0, g = 0.0;
    Moments all;
    all.count = n;
    for (std::size_t p = 0; p < sums.size(); ++p) {
      const PatchSums& sum = sums[p];
      const UltrasoundPatches::Patch& patch = us_->patches[p];
      u += static_cast<double>(patch.count) * patch.mean;
      m += sum.m;
      g += sum.g;
      all.uu += patch.square_sum + static_cast<double>(patch.count) * patch.mean * patch.mean;
      all.mm += sum.mm;
      all.gg += sum.gg;
      all.mg += sum.mg;
      all.um += sum.um + patch.mean * sum.m;
      all.ug += sum.ug + patch.mean * sum.g;
    }
    all.uu -= u * u / n;
    all.mm = hu * hu * (all.mm - m * m / n);
    all.gg = hu * hu * (all.gg - g * g / n);
    all.mg = hu * hu * (all.mg - m * g / n);
    all.um = hu * (all.um - u * m / n);
    all.ug = hu * (all.ug - u * g / n);
    return all;
  }

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  std::vector<double> weights_;  // of the patches; their sum is 1
  double mean_ = 0.0;            // of the ultrasound in all patches
  double square_sum_ = 0.0;      // of the ultrasound minus that mean
};

}  // namespace

const char* kind_name(SimilarityKind kind) { return kKindNames[static_cast<std::size_t>(kind)]; }

SimilarityKind parse_kind(const std::string& name, const std::string& source) {
  for (std::size_t i = 0; i < kKindNames.size(); ++i)
    if (name == kKindNames[i]) return static_cast<SimilarityKind>(i);
  throw InputError(source, "similarity is '" + name +
                               "', must be local_lc2, global_lc2, ncc, mattes_mi, nmi, "
                               "correlation_ratio, joint_correlation_ratio or simulated_lc2");
}

void SimilarityOptions::validate(const std::string& source) const {
  patches.validate(source);
  require(std::isfinite(ridge_intensity_hu) && ridge_intensity_hu >= 0.0, source,
          "ridge_intensity_hu", ridge_intensity_hu, "finite and >= 0");
  require(std::isfinite(ridge_gradient_hu_per_mm) && ridge_gradient_hu_per_mm >= 0.0, source,
          "ridge_gradient_hu_per_mm", ridge_gradient_hu_per_mm, "finite and >= 0");
  require(power >= 0.25 && power <= 8.0, source, "power", power, "within [0.25, 8]");
  require(gradient_bins >= 2 && gradient_bins <= 32, source, "gradient_bins", gradient_bins,
          "within [2, 32]");
  require(is_positive(gradient_scale_hu_per_mm), source, "gradient_scale_hu_per_mm",
          gradient_scale_hu_per_mm, "finite and > 0");
  require(bins >= 8 && bins <= 128, source, "bins", bins, "within [8, 128]");
}

std::shared_ptr<const Similarity> make_patch_similarity(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options) {
  options.validate();
  if (options.kind == SimilarityKind::kSimulatedLc2)
    throw InputError("similarity options", "'kind' is simulated_lc2, must be one with patches");
  if (ultrasound->patches.empty())
    throw InputError("ultrasound", "has no patch with structure, must have one at least");
  return std::make_shared<PatchSimilarity>(std::move(ultrasound), std::move(ct), options);
}

}  // namespace usct
