#include "us_ct_registration/similarity/patch_similarity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "parallel.h"
#include "require.h"
#include "similarity/histogram_similarity.h"
#include "similarity/patch_kernel.h"
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

/// Blocks that are summed before their sums are used: what the first cache holds.
constexpr std::size_t kTile = 32;

/// Calls use(block, sums) for the blocks [first, last), in order.
template <typename Use>
void for_blocks(const PatchKernelInput& input, bool scalar, std::size_t first, std::size_t last,
                const Use& use) {
  std::array<StrandSums, kTile> sums;
  for (std::size_t begin = first; begin < last; begin += kTile) {
    const std::size_t end = std::min(last, begin + kTile);
    (scalar ? sum_strands_scalar : sum_strands_simd)(input, begin, end, sums.data());
    for (std::size_t b = begin; b < end; ++b) use(b, sums[b - begin]);
  }
}

/// Adds the sums of a strand, but those of the ultrasound; `mean` is added to it.
void add_strand(const StrandSums& sums, std::size_t lane, double mean, PatchMoments& moments) {
  const double m = sums.m[lane];
  const double g = sums.g[lane];
  moments.m += m;
  moments.g += g;
  moments.mm += sums.mm[lane];
  moments.gg += sums.gg[lane];
  moments.mg += sums.mg[lane];
  moments.um += sums.um[lane] + mean * m;
  moments.ug += sums.ug[lane] + mean * g;
}

double sum_of(const float* lanes) {
  double sum = 0.0;
  for (std::size_t i = 0; i < kLanes; ++i) sum += static_cast<double>(lanes[i]);
  return sum;
}

Lc2Ridge ridge_of(const SimilarityOptions& options, const PackedCt& ct) {
  return {options.ridge_intensity_hu / ct.step_hu(),
          options.ridge_gradient_hu_per_mm / ct.step_hu(), options.positive_gradient};
}

double structure_in(const UltrasoundPatches::Patch& patch, PatchWeighting weighting) {
  const auto count = static_cast<double>(patch.count);
  switch (weighting) {
    case PatchWeighting::kCount:
      return count;
    case PatchWeighting::kDeviation:
      return std::sqrt(count * patch.square_sum);
    case PatchWeighting::kVariance:
      return patch.square_sum;
  }
  return 0.0;
}

double weight_of(const UltrasoundPatches::Patch& patch, const SimilarityOptions& options) {
  const double structure = structure_in(patch, options.weighting);
  if (options.pressed_mm == 0.0) return structure;
  const double depth = patch.depth_mm / options.pressed_mm;
  return structure * depth * depth / (depth * depth + 1.0);
}

class LocalLc2 : public Similarity {
 public:
  LocalLc2(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
           const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options), ridge_(ridge_of(options, *ct_)) {
    double sum = 0.0;
    for (const UltrasoundPatches::Patch& patch : us_->patches) {
      weights_.push_back(weight_of(patch, options));
      sum += weights_.back();
    }
    for (double& weight : weights_) weight /= sum;
    for (std::size_t p = us_->first_single_patch; p < us_->patches.size(); ++p) {
      counts_.push_back(static_cast<double>(us_->patches[p].count));
      square_sums_.push_back(us_->patches[p].square_sum);
    }
    const std::size_t lanes = (us_->blocks.size() - us_->first_single_block) * kLanes;
    counts_.resize(lanes);
    square_sums_.resize(lanes);
  }

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    std::vector<double> each(us_->patches.size());
    const double inside = fill_parts(T_ct_us, errors, each);
    if (inside == 0.0) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
    return {std::accumulate(each.begin(), each.end(), 0.0),
            inside / static_cast<double>(us_->count)};
  }

  std::vector<double> parts(const Eigen::Isometry3d& T_ct_us,
                            const AcquisitionErrors& errors) const override {
    std::vector<double> result(us_->patches.size());
    if (fill_parts(T_ct_us, errors, result) == 0.0)
      std::fill(result.begin(), result.end(), std::numeric_limits<double>::quiet_NaN());
    return result;
  }

 private:
  /// What each patch contributes; returns how many samples lie in the CT. Shared between threads
  /// where the caller's work is not.
  double fill_parts(const Eigen::Isometry3d& T_ct_us, const AcquisitionErrors& errors,
                    std::vector<double>& parts) const {
    const PatchKernelInput input = kernel_input(*us_, *ct_, T_ct_us, errors, options_.channel);
    // Fewer are done before a thread has woken up.
    constexpr std::size_t kAtOnce = kTile / 2;
    const std::size_t first = us_->first_single_block;
    const std::size_t shares = (us_->blocks.size() - first + kAtOnce - 1) / kAtOnce;
    std::vector<double> inside(shares + 1);
    const auto share = [&](std::size_t i) {
      const std::size_t begin = first + i * kAtOnce;
      inside[i] =
          fill_single(input, begin, std::min(us_->blocks.size(), begin + kAtOnce), parts.data());
    };
    inside[shares] = fill_long(input, parts.data());
    if (shares == 1)
      share(0);
    else
      parallel_for(static_cast<int>(shares), [&](int i) { share(static_cast<std::size_t>(i)); });
    return std::accumulate(inside.begin(), inside.end(), 0.0);
  }

  /// The patches of several strands.
  double fill_long(const PatchKernelInput& input, double* parts) const {
    double inside = 0.0;
    std::size_t p = 0;
    std::size_t strands = 0;  // of patch p so far
    PatchMoments moments;
    for_blocks(input, options_.scalar, 0, us_->first_single_block,
               [&](std::size_t, const StrandSums& sums) {
                 inside += sum_of(sums.inside);
                 for (std::size_t lane = 0; lane < kLanes && p < us_->first_single_patch; ++lane) {
                   add_strand(sums, lane, 0.0, moments);
                   const UltrasoundPatches::Patch& patch = us_->patches[p];
                   if (++strands < patch.strands()) continue;
                   moments.count = static_cast<double>(patch.count);
                   moments.uu = patch.square_sum;
                   parts[p] = part_of(p, explained_share(moments, ridge_));
                   ++p;
                   strands = 0;
                   moments = {};
                 }
               });
    return inside;
  }

  /// The patches of one strand in the blocks [first, last).
  double fill_single(const PatchKernelInput& input, std::size_t first, std::size_t last,
                     double* parts) const {
    double inside = 0.0;
    const auto explained = options_.scalar ? explained_shares_scalar : explained_shares_simd;
    for_blocks(input, options_.scalar, first, last, [&](std::size_t b, const StrandSums& sums) {
      inside += sum_of(sums.inside);
      const std::size_t start = (b - us_->first_single_block) * kLanes;
      std::array<double, kLanes> shares{};
      explained(sums, counts_.data() + start, square_sums_.data() + start, ridge_, shares.data());
      std::size_t p = us_->first_single_patch + start;
      for (std::size_t lane = 0; lane < kLanes && p < us_->patches.size(); ++lane, ++p)
        parts[p] = part_of(p, shares[lane]);
    });
    return inside;
  }

  double part_of(std::size_t p, double share) const {
    if (options_.power == 1.0) return weights_[p] * share;
    if (options_.power == 2.0) return weights_[p] * share * share;
    return weights_[p] * std::pow(share, options_.power);
  }

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  Lc2Ridge ridge_;
  std::vector<double> weights_;  // of the patches; their sum is 1
  // Of the patches of one strand, per lane.
  std::vector<double> counts_;
  std::vector<double> square_sums_;
};

/// Global LC2 and NCC.
class GlobalMoments : public Similarity {
 public:
  GlobalMoments(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
                const SimilarityOptions& options)
      : us_(std::move(us)), ct_(std::move(ct)), options_(options), ridge_(ridge_of(options, *ct_)) {
    const double mean = mean_of(*us_);
    means_.resize(us_->blocks.size() * kLanes);
    for (const UltrasoundPatches::Patch& patch : us_->patches) {
      const double above = patch.mean - mean;
      square_sum_ += patch.square_sum + static_cast<double>(patch.count) * above * above;
      for (std::size_t i = 0; i < patch.strands(); ++i) means_[patch.first_strand + i] = above;
    }
  }

  SimilarityValue evaluate(const Eigen::Isometry3d& T_ct_us,
                           const AcquisitionErrors& errors) const override {
    const PatchKernelInput input = kernel_input(*us_, *ct_, T_ct_us, errors, options_.channel);
    PatchMoments moments;
    moments.count = static_cast<double>(us_->count);
    moments.uu = square_sum_;
    double inside = 0.0;
    for_blocks(input, options_.scalar, 0, us_->blocks.size(),
               [&](std::size_t b, const StrandSums& sums) {
                 inside += sum_of(sums.inside);
                 for (std::size_t lane = 0; lane < kLanes; ++lane)
                   add_strand(sums, lane, means_[b * kLanes + lane], moments);
               });
    if (inside == 0.0) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
    return {value_of(moments), inside / moments.count};
  }

 private:
  double value_of(const PatchMoments& sums) const {
    if (options_.kind == SimilarityKind::kGlobalLc2) return explained_share(sums, ridge_);
    const double mm = sums.mm - sums.m * sums.m / sums.count;
    return mm > kLc2Floor * sums.mm ? sums.um / std::sqrt(sums.uu * mm) : 0.0;
  }

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  SimilarityOptions options_;
  Lc2Ridge ridge_;
  double square_sum_ = 0.0;    // of the ultrasound minus its mean
  std::vector<double> means_;  // of the strands' patches, minus that of all
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
  require(pressed_mm >= 0.0 && pressed_mm <= 200.0, source, "pressed_mm", pressed_mm,
          "within [0, 200]");
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
  switch (options.kind) {
    case SimilarityKind::kLocalLc2:
      return std::make_shared<LocalLc2>(std::move(ultrasound), std::move(ct), options);
    case SimilarityKind::kGlobalLc2:
    case SimilarityKind::kNcc:
      return std::make_shared<GlobalMoments>(std::move(ultrasound), std::move(ct), options);
    case SimilarityKind::kMattesMi:
    case SimilarityKind::kNmi:
      return make_mutual_information(std::move(ultrasound), std::move(ct), options);
    case SimilarityKind::kCorrelationRatio:
      return make_correlation_ratio(std::move(ultrasound), std::move(ct), options);
    case SimilarityKind::kJointCorrelationRatio:
      return make_joint_correlation_ratio(std::move(ultrasound), std::move(ct), options);
    case SimilarityKind::kSimulatedLc2:
      break;
  }
  throw InputError("similarity options", "'kind' is unknown, must be a SimilarityKind");
}

}  // namespace usct
