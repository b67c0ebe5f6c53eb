#include "us_ct_registration/similarity/nmi.h"

#include <algorithm>

#include "similarity/joint_histogram.h"
#include "similarity/pose_by_pose.h"
#include "similarity/require_metric.h"

namespace usct {
namespace {

class Nmi final : public PoseByPose {
 public:
  explicit Nmi(JointHistogram histogram) : histogram_(std::move(histogram)) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    return histogram_.evaluate(pose, [](const Entropies& entropy) {
      return entropy.joint > 0.0 ? (entropy.us + entropy.ct) / entropy.joint : 1.0;
    });
  }

  JointHistogram histogram_;
};

}  // namespace

SimilarityNeeds NmiOptions::needs() const { return needs_of_patches(); }

void NmiOptions::validate(const std::string& source) const {
  patches.validate(source);
  require_bins(bins, source);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const NmiOptions& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<Nmi>(
      JointHistogram({std::move(patches), images.packed_ct(), images.backend()}, options.bins));
}

}  // namespace usct
