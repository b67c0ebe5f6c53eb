#pragma once

#include <memory>
#include <string>

#include "us_ct_registration/similarity/similarity.h"
#include "us_ct_registration/similarity/similarity_images.h"

/// The interface of a metric's file. The options of metric M are a struct with
///
///     static constexpr const char* kName;               // the name of M in files
///     SimilarityNeeds needs() const;                    // the images that M uses
///     void validate(const std::string& source) const;   // throws InputError
///     describe(fields, options)                         // its keys in files, beside the struct
///
/// and `make(SimilarityImages&, const M's options&)` makes the similarity. catalogue.h lists them.
namespace usct {

/// The images that a metric needs, the AcquisitionErrors that it can follow, and whether it has
/// parts and derivatives.
struct SimilarityNeeds {
  /// Ultrasound cut into patches, and the CT averaged to the level's spacing and packed.
  bool patches = false;
  /// The CT as it was recorded, from the array on: whole beams are simulated through it.
  bool recorded_ct = false;
  /// The direction of each sample's beam, even where no AcquisitionErrors are estimated.
  bool beams = false;
  bool follows_depth_error = false;
  bool follows_sweep_error = false;
  /// Whether it is a sum over patches, which Similarity::parts gives.
  bool has_parts = false;
  /// Whether Similarity::derivatives gives any.
  bool has_derivatives = false;
};

/// All metrics on patches need the patches, which follow every acquisition error.
inline SimilarityNeeds needs_of_patches() {
  SimilarityNeeds needs;
  needs.patches = true;
  needs.follows_depth_error = needs.follows_sweep_error = true;
  return needs;
}

}  // namespace usct
