#include "us_ct_registration/similarity/mattes_mi.h"

#include <algorithm>

#include "similarity/joint_histogram.h"
#include "similarity/pose_by_pose.h"
#include "similarity/require_metric.h"

namespace usct {
namespace {

class MattesMi final : public PoseByPose {
 public:
  explicit MattesMi(JointHistogram histogram) : histogram_(std::move(histogram)) {}

 private:
  SimilarityValue value_at(const SimilarityPose& pose) const override {
    return histogram_.evaluate(pose, [](const Entropies& entropy) {
      return std::max(0.0, entropy.us + entropy.ct - entropy.joint);
    });
  }

  JointHistogram histogram_;
};

}  // namespace

SimilarityNeeds MattesMiOptions::needs() const { return needs_of_patches(); }

void MattesMiOptions::validate(const std::string& source) const {
  patches.validate(source);
  require_bins(bins, source);
}

std::shared_ptr<const Similarity> make(SimilarityImages& images, const MattesMiOptions& options) {
  auto patches = images.patches(options.patches);
  if (!patches) return nullptr;
  return std::make_shared<MattesMi>(
      JointHistogram({std::move(patches), images.packed_ct(), images.backend()}, options.bins));
}

}  // namespace usct
