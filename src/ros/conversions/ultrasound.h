#pragma once

#include <us_ct_registration/PreScanVolume.h>

#include <string>

#include "us_ct_registration/ultrasound/prescan_volume.h"

namespace usct::ros_interface {

/// The header's stamp is the end of the acquisition.
us_ct_registration::PreScanVolume to_message(const PreScanVolume& volume,
                                             const std_msgs::Header& header);
PreScanVolume from_message(const us_ct_registration::PreScanVolume& message,
                           const std::string& source);

}  // namespace usct::ros_interface
