#pragma once

#include "us_ct_registration/volume/volume.h"

/// Masks of the objects in a CT and in its label map: 255 in the object, 0 elsewhere.
namespace usct::phantom {

/// The source that errors of the scene "from-ct" name.
constexpr const char* kFromCt = "from-ct";
/// HU below which a CT shows air.
constexpr float kAirHu = -300.0F;
/// Approximate size of the voxels of the body's mask, unless those of the CT are larger.
constexpr double kBodyVoxelMm = 2.5;

/// The body: the largest connected object that is not air, together with the air that it encloses
/// in an axial plane (lungs, bowel). Throws InputError if the CT shows no body.
MaskVolume body_mask(const CtVolume& ct);

/// The voxels with a label, on the part of the map's grid that reaches 30 mm beyond them. Throws
/// InputError if the map does not hold the label.
MaskVolume mask_of_label(const LabelVolume& labels, int label);

}  // namespace usct::phantom
