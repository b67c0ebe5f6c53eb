#include "us_ct_registration/similarity/similarity_images.h"

#include <algorithm>
#include <stdexcept>

#include "similarity/packed_ct.h"
#include "similarity/ultrasound_patches.h"

namespace usct {

std::shared_ptr<const PackedCt> pack_ct(const Volume<float>& ct_hu, const HuWindow& window,
                                        double background_hu) {
  return std::make_shared<const PackedCt>(ct_hu, window, background_hu);
}

SimilarityImages::SimilarityImages(std::shared_ptr<const BeamUltrasound> ultrasound,
                                   std::shared_ptr<const PackedCt> packed_ct,
                                   std::shared_ptr<const CtVolume> recorded_ct, bool with_beams,
                                   const SimilarityBackend& backend)
    : ultrasound_(std::move(ultrasound)),
      packed_ct_(std::move(packed_ct)),
      recorded_ct_(std::move(recorded_ct)),
      with_beams_(with_beams),
      backend_(backend) {}

std::shared_ptr<const UltrasoundPatches> SimilarityImages::patches(const PatchOptions& options) {
  auto found = std::find_if(patches_.begin(), patches_.end(),
                            [&](const auto& cut) { return cut.first == options; });
  if (found == patches_.end()) {
    const PatchContents contents =
        with_beams_ ? PatchContents::kWithBeams : PatchContents::kPositions;
    found =
        patches_.insert(found, {options, std::make_shared<const UltrasoundPatches>(
                                             cut_into_patches(*ultrasound_, options, contents))});
  }
  return found->second->patches.empty() ? nullptr : found->second;
}

std::shared_ptr<const PackedCt> SimilarityImages::packed_ct() const {
  if (!packed_ct_) throw std::logic_error("a metric of patches was given no packed CT");
  return packed_ct_;
}

const CtVolume& SimilarityImages::recorded_ct() const {
  if (!recorded_ct_) throw std::logic_error("a metric that simulates was given no recorded CT");
  return *recorded_ct_;
}

}  // namespace usct
