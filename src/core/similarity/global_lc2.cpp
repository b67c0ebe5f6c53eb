#include "us_ct_registration/similarity/global_lc2.h"

#include <cmath>

#include "similarity/global_moments.h"
#include "similarity/pose_by_pose.h"

namespace usct {
namespace {

class GlobalLc2 final : public PoseByPose {
 public:
  GlobalLc2(GlobalMoments moments, const GlobalLc2Options& options)
      : moments_(std::move(moments)), ridge_(ridge_of(options, moments_.ct())) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    return moments_.evaluate(
        pose, [&](const PatchMoments& sums) { return explained_share(sums, ridge_); });
  }

  GlobalMoments moments_;
  Lc2Ridge ridge_;
};

}  // namespace

SimilarityNeeds GlobalLc2Options::needs() const {
  SimilarityNeeds needs = needs_of_patches();
  needs.beams = channel == GradientChannel::kAlongBeam;
  return needs;
}

void GlobalLc2Options::validate(const std::string& source) const {
  Lc2Options::validate(source);
  patches.validate(source);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const GlobalLc2Options& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<GlobalLc2>(
      GlobalMoments(std::move(patches), images.packed_ct(), options.channel, images.backend()),
      options);
}

}  // namespace usct
