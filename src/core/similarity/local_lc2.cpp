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
  /// Fills in the contribution of each patch, and returns how many samples lie in the CT. The
  /// threads share the patches if the caller does not share poses among them.
  double fill_parts(const SimilarityPose& pose, std::vector<double>& parts) const {
    const PatchKernelInput input = kernel_input(*us_, *ct_, pose, options_.channel);
    // A smaller share of the work would be done before another thread has woken up.
    constexpr std::size_t kAtOnce = kBlocksAtOnce / 2;
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

  /// Fills in the contributions of patches of several strands.
  double fill_long(const PatchKernelInput& input, double* parts) const {
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
                   parts[p] = part_of(p, explained_share(moments, ridge_));
                   ++p;
                   strands = 0;
                   moments = {};
                 }
               });
    return inside;
  }

  /// Fills in the contributions of single-strand patches in the blocks [first, last).
  double fill_single(const PatchKernelInput& input, std::size_t first, std::size_t last,
                     double* parts) const {
    double inside = 0.0;
    for_blocks(backend_, input, first, last, [&](std::size_t b, const StrandSums& sums) {
      inside += sum_of_lanes(sums.inside);
      const std::size_t start = (b - us_->first_single_block) * kLanes;
      std::array<double, kLanes> shares{};
      backend_.explained_shares(sums, counts_.data() + start, square_sums_.data() + start, ridge_,
                                shares.data());
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
  SimilarityNeeds needs;
  needs.patches = true;
  needs.beams = channel == GradientChannel::kAlongBeam;
  needs.follows_depth_error = needs.follows_sweep_error = true;
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
