#include "us_ct_registration/similarity/local_lc2.h"

#include <cmath>
#include <limits>
#include <numeric>

#include "require.h"
#include "similarity/pose_by_pose.h"
#include "similarity/strand_sums.h"

namespace usct {
namespace {

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

/// Weight of a patch. The probe compresses shallow patches: see LocalLc2Options::pressed_mm.
double weight_of(const UltrasoundPatches::Patch& patch, const LocalLc2Options& options) {
  const double structure = structure_in(patch, options.weighting);
  if (options.pressed_mm == 0.0) return structure;
  const double depth = patch.depth_mm / options.pressed_mm;
  return structure * depth * depth / (depth * depth + 1.0);
}

class LocalLc2 final : public PoseByPose {
 public:
  LocalLc2(std::shared_ptr<const UltrasoundPatches> us, std::shared_ptr<const PackedCt> ct,
           const LocalLc2Options& options, const SimilarityBackend& backend)
      : us_(std::move(us)),
        ct_(std::move(ct)),
        options_(options),
        backend_(backend),
        ridge_(ridge_of(options, *ct_)) {
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

  SimilarityValue value_at(const SimilarityPose& pose) const override {
    std::vector<double> each(us_->patches.size());
    const double inside = fill_parts(pose, each);
    if (inside == 0.0) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
    return {std::accumulate(each.begin(), each.end(), 0.0),
            inside / static_cast<double>(us_->count)};
  }

  std::optional<SimilarityDerivatives> derivatives(const SimilarityPose& pose,
                                                   DerivativeOrder order,
                                                   double /*above*/) const override {
    if (options_.channel != GradientChannel::kMagnitude) return std::nullopt;
    const PatchKernelInput input = kernel_input(*us_, *ct_, pose, options_.channel);
    std::vector<double> each(us_->patches.size());
    std::vector<double> inside(shares() + 1);
    std::vector<PoseDerivatives> sums(shares() + 1, PoseDerivatives(input, order));
    parallel_for(static_cast<int>(inside.size()), [&](int i) {
      const auto share = static_cast<std::size_t>(i);
      inside[share] = share == shares()
                          ? differentiate_long(input, order, each.data(), sums[share])
                          : differentiate_single(input, share, order, each.data(), sums[share]);
    });
    SimilarityDerivatives result;
    const double samples = std::accumulate(inside.begin(), inside.end(), 0.0);
    if (samples == 0.0) return result;
    result.value = {std::accumulate(each.begin(), each.end(), 0.0),
                    samples / static_cast<double>(us_->count)};
    for (std::size_t share = 1; share < sums.size(); ++share) sums[0].add(sums[share]);
    result.gradient = sums[0].gradient();
    result.curvature = sums[0].curvature();
    return result;
  }

  bool has_error_derivatives() const override {
    return options_.channel == GradientChannel::kMagnitude && us_->has_beams();
  }

  std::vector<Eigen::Vector3d> part_centres_us_mm() const override {
    std::vector<Eigen::Vector3d> centres;
    centres.reserve(us_->patches.size());
    for (const UltrasoundPatches::Patch& patch : us_->patches)
      centres.push_back(patch.centre_us_mm);
    return centres;
  }

  std::vector<double> parts(const SimilarityPose& pose) const override {
    std::vector<double> result(us_->patches.size());
    if (fill_parts(pose, result) == 0.0)
      std::fill(result.begin(), result.end(), std::numeric_limits<double>::quiet_NaN());
    return result;
  }

 private:
  /// The fit of a patch at a pose; its contribution changes by `factor` times the change of its
  /// explained share.
  struct Fit {
    PatchMoments moments;
    ShareSlopes slopes;
    double factor = 0.0;
  };

  /// The threads share the blocks of single-strand patches. A smaller share would be done before
  /// another thread has woken up.
  static constexpr std::size_t kAtOnce = kBlocksAtOnce / 2;
  std::size_t shares() const {
    return (us_->blocks.size() - us_->first_single_block + kAtOnce - 1) / kAtOnce;
  }
  /// The first block of a share.
  std::size_t begin_of(std::size_t share) const {
    return std::min(us_->blocks.size(), us_->first_single_block + share * kAtOnce);
  }

  /// Fills in the contribution of each patch, and returns how many samples lie in the CT. The
  /// threads share the patches if the caller does not share poses among them.
  double fill_parts(const SimilarityPose& pose, std::vector<double>& parts) const {
    const PatchKernelInput input = kernel_input(*us_, *ct_, pose, options_.channel);
    std::vector<double> inside(shares() + 1);
    const auto share = [&](std::size_t i) {
      for_blocks(backend_, input, begin_of(i), begin_of(i + 1),
                 [&](std::size_t b, const StrandSums& sums) {
                   inside[i] += sum_of_lanes(sums.inside);
                   std::array<double, kLanes> explained{};
                   fill_block(b, sums, explained, parts.data());
                 });
    };
    inside[shares()] = fill_long(input, parts.data(), nullptr);
    if (shares() == 1)
      share(0);
    else
      parallel_for(static_cast<int>(shares()), [&](int i) { share(static_cast<std::size_t>(i)); });
    return std::accumulate(inside.begin(), inside.end(), 0.0);
  }

  /// Fills in the contributions of patches of several strands, and their fits unless null.
  double fill_long(const PatchKernelInput& input, double* parts, Fit* fits) const {
    double inside = 0.0;
    std::size_t p = 0;
    std::size_t strands = 0;  // strands of patch p so far
    PatchMoments moments;
    for_blocks(backend_, input, 0, us_->first_single_block,
               [&](std::size_t, const StrandSums& sums) {
                 inside += sum_of_lanes(sums.inside);
                 for (std::size_t lane = 0; lane < kLanes && p < us_->first_single_patch; ++lane) {
                   add_strand(sums, lane, 0.0, moments);
                   const UltrasoundPatches::Patch& patch = us_->patches[p];
                   if (++strands < patch.strands()) continue;
                   moments.count = static_cast<double>(patch.count);
                   moments.uu = patch.square_sum;
                   const double share = explained_share(moments, ridge_);
                   parts[p] = part_of(p, share);
                   if (fits != nullptr) fits[p] = fit_of(p, moments, share);
                   ++p;
                   strands = 0;
                   moments = {};
                 }
               });
    return inside;
  }

  /// The first patch of a block of single-strand patches, which has one in each lane.
  std::size_t first_patch(std::size_t block) const {
    return us_->first_single_patch + (block - us_->first_single_block) * kLanes;
  }
  std::size_t patches_in(std::size_t block) const {
    return std::min(kLanes, us_->patches.size() - first_patch(block));
  }

  /// Fills in shares and contributions of the single-strand patches of a block.
  void fill_block(std::size_t block, const StrandSums& sums, std::array<double, kLanes>& explained,
                  double* parts) const {
    const std::size_t start = (block - us_->first_single_block) * kLanes;
    backend_.explained_shares(sums, counts_.data() + start, square_sums_.data() + start, ridge_,
                              explained.data());
    const std::size_t p = first_patch(block);
    for (std::size_t lane = 0; lane < patches_in(block); ++lane)
      parts[p + lane] = part_of(p + lane, explained[lane]);
  }

  Fit fit_of(std::size_t p, const PatchMoments& moments, double share) const {
    Fit fit{moments, share_slopes(moments, ridge_), weights_[p]};
    if (options_.power != 1.0)
      fit.factor *= share > 0.0 ? options_.power * std::pow(share, options_.power - 1.0) : 0.0;
    return fit;
  }

  /// Fills in the contributions of the single-strand patches of a share, and adds their
  /// derivatives. The samples of a block stay in the cache between the fit and its derivatives.
  double differentiate_single(const PatchKernelInput& input, std::size_t share,
                              DerivativeOrder order, double* parts, PoseDerivatives& result) const {
    const auto samples = std::make_unique<BlockSamples>();
    double inside = 0.0;
    for (std::size_t block = begin_of(share); block < begin_of(share + 1); ++block) {
      StrandSums sums;
      backend_.sample_derivatives(input, block, *samples, sums);
      inside += sum_of_lanes(sums.inside);
      std::array<double, kLanes> explained{};
      fill_block(block, sums, explained, parts);
      const std::size_t first = first_patch(block);
      std::array<Fit, kLanes> fits;
      StrandSlopes slopes{};
      for (std::size_t lane = 0; lane < patches_in(block); ++lane) {
        const UltrasoundPatches::Patch& patch = us_->patches[first + lane];
        PatchMoments moments;
        moments.count = static_cast<double>(patch.count);
        moments.uu = patch.square_sum;
        add_strand(sums, lane, 0.0, moments);
        fits[lane] = fit_of(first + lane, moments, explained[lane]);
        slopes.set(lane, fits[lane].slopes);
      }
      DerivativeSums derivatives;
      backend_.sum_derivatives(*us_, block, *samples, slopes, order, derivatives);
      for (std::size_t lane = 0; lane < patches_in(block); ++lane) {
        PatchDerivativeSums of_patch;
        of_patch.add(derivatives, lane, order);
        add_patch(first + lane, fits[lane], of_patch, result);
      }
    }
    return inside;
  }

  /// The same for patches of several strands, which are sampled twice.
  double differentiate_long(const PatchKernelInput& input, DerivativeOrder order, double* parts,
                            PoseDerivatives& result) const {
    if (us_->first_single_block == 0) return 0.0;
    std::vector<Fit> fits(us_->first_single_patch);
    const double inside = fill_long(input, parts, fits.data());
    std::vector<StrandSlopes> slopes(us_->first_single_block, StrandSlopes{});
    for (std::size_t p = 0; p < fits.size(); ++p)
      for (std::size_t i = 0; i < us_->patches[p].strands(); ++i) {
        const std::size_t strand = us_->patches[p].first_strand + i;
        slopes[strand / kLanes].set(strand % kLanes, fits[p].slopes);
      }
    const auto samples = std::make_unique<BlockSamples>();
    PatchDerivativeSums of_patch;
    std::size_t p = 0;
    std::size_t strands = 0;  // strands of patch p so far
    for (std::size_t block = 0; block < us_->first_single_block; ++block) {
      StrandSums sums;
      DerivativeSums derivatives;
      backend_.sample_derivatives(input, block, *samples, sums);
      backend_.sum_derivatives(*us_, block, *samples, slopes[block], order, derivatives);
      for (std::size_t lane = 0; lane < kLanes && p < fits.size(); ++lane) {
        of_patch.add(derivatives, lane, order);
        if (++strands < us_->patches[p].strands()) continue;
        add_patch(p, fits[p], of_patch, result);
        ++p;
        strands = 0;
        of_patch = {};
      }
    }
    return inside;
  }

  void add_patch(std::size_t p, const Fit& fit, const PatchDerivativeSums& sums,
                 PoseDerivatives& result) const {
    result.add(p, fit.factor, share_derivatives(fit.moments, fit.slopes, sums));
  }

  double part_of(std::size_t p, double share) const {
    if (options_.power == 1.0) return weights_[p] * share;
    if (options_.power == 2.0) return weights_[p] * share * share;
    return weights_[p] * std::pow(share, options_.power);
  }

  std::shared_ptr<const UltrasoundPatches> us_;
  std::shared_ptr<const PackedCt> ct_;
  LocalLc2Options options_;
  const SimilarityBackend& backend_;
  Lc2Ridge ridge_;
  std::vector<double> weights_;  // one per patch; their sum is 1
  // Sums of the single-strand patches, per lane.
  std::vector<double> counts_;
  std::vector<double> square_sums_;
};

}  // namespace

SimilarityNeeds LocalLc2Options::needs() const {
  SimilarityNeeds needs = needs_of_patches();
  needs.has_parts = true;
  needs.beams = channel == GradientChannel::kAlongBeam;
  needs.has_derivatives = channel == GradientChannel::kMagnitude;
  return needs;
}

void LocalLc2Options::validate(const std::string& source) const {
  Lc2Options::validate(source);
  patches.validate(source);
  require(pressed_mm >= 0.0 && pressed_mm <= 200.0, source, "pressed_mm", pressed_mm,
          "within [0, 200]");
  require(power >= 0.25 && power <= 8.0, source, "power", power, "within [0.25, 8]");
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const LocalLc2Options& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<LocalLc2>(std::move(patches), images.packed_ct(), options,
                                    images.backend());
}

}  // namespace usct
