#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "us_ct_registration/similarity/patch_options.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

class PackedCt;
struct SimilarityBackend;
struct UltrasoundPatches;

/// A CT made for fast sampling: limited to the window and kept in 8 bits. `background_hu` is the CT
/// value outside the CT. Throws InputError if the grid is invalid or smaller than 2 voxels along an
/// axis, or if the window is invalid, or the background lies outside it.
std::shared_ptr<const PackedCt> pack_ct(const Volume<float>& ct_hu, const HuWindow& window,
                                        double background_hu);

/// The scalar reference of all kernels, and the kernels in vector instructions (chosen for the
/// machine at run time: AVX-512, AVX2, SSE, NEON), which tests hold to it.
const SimilarityBackend& scalar_backend();
const SimilarityBackend& simd_backend();

/// Ultrasound and CT as the similarities of one level use them. Data that several similarities need
/// are made on first use, and shared.
class SimilarityImages {
 public:
  /// A CT may be left out (null) where no similarity needs it: metrics of patches sample
  /// `packed_ct`, metrics that simulate whole beams follow them through `recorded_ct`. `with_beams`
  /// keeps the direction of each sample's beam (see SimilarityNeeds::beams), which then takes three
  /// quarters of the memory.
  SimilarityImages(std::shared_ptr<const BeamUltrasound> ultrasound,
                   std::shared_ptr<const PackedCt> packed_ct,
                   std::shared_ptr<const CtVolume> recorded_ct, bool with_beams = true,
                   const SimilarityBackend& backend = simd_backend());

  const BeamUltrasound& ultrasound() const { return *ultrasound_; }
  /// Null if no patch of the ultrasound has structure. Must not be called from several threads.
  std::shared_ptr<const UltrasoundPatches> patches(const PatchOptions& options);
  /// Throw std::logic_error if there is no such CT.
  std::shared_ptr<const PackedCt> packed_ct() const;
  const CtVolume& recorded_ct() const;
  const SimilarityBackend& backend() const { return backend_; }

 private:
  std::shared_ptr<const BeamUltrasound> ultrasound_;
  std::shared_ptr<const PackedCt> packed_ct_;
  std::shared_ptr<const CtVolume> recorded_ct_;
  bool with_beams_;
  const SimilarityBackend& backend_;
  std::vector<std::pair<PatchOptions, std::shared_ptr<const UltrasoundPatches>>> patches_;
};

}  // namespace usct
