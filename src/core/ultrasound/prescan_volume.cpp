#include "us_ct_registration/ultrasound/prescan_volume.h"

#include "us_ct_registration/error.h"

namespace usct {

void PreScanVolume::validate(const std::string& source) const {
  geometry.validate(source);
  const std::size_t expected = static_cast<std::size_t>(geometry.samples()) *
                               static_cast<std::size_t>(geometry.lines()) *
                               static_cast<std::size_t>(geometry.frames());
  if (voxels.size() != expected)
    throw InputError(source, "holds " + std::to_string(voxels.size()) + " voxels, must hold " +
                                 std::to_string(geometry.samples()) + " samples x " +
                                 std::to_string(geometry.lines()) + " lines x " +
                                 std::to_string(geometry.frames()) + " frames");
}

}  // namespace usct
