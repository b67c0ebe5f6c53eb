#include "us_ct_registration/similarity/ncc.h"

#include <cmath>

#include "similarity/global_moments.h"
#include "similarity/pose_by_pose.h"

namespace usct {
namespace {

class Ncc final : public PoseByPose {
 public:
  explicit Ncc(GlobalMoments moments) : moments_(std::move(moments)) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    return moments_.evaluate(pose, [](const PatchMoments& sums) {
      const double mm = sums.mm - sums.m * sums.m / sums.count;
      return mm > kLc2Floor * sums.mm ? sums.um / std::sqrt(sums.uu * mm) : 0.0;
    });
  }

  GlobalMoments moments_;
};

}  // namespace

SimilarityNeeds NccOptions::needs() const { return needs_of_patches(); }

void NccOptions::validate(const std::string& source) const { patches.validate(source); }

std::shared_ptr<const Similarity> make(SimilarityImages& images, const NccOptions& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<Ncc>(GlobalMoments(std::move(patches), images.packed_ct(),
                                             GradientChannel::kMagnitude, images.backend()));
}

}  // namespace usct
