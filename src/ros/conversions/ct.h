#pragma once

#include <us_ct_registration/CtVolume.h>

#include <string>

#include "us_ct_registration/volume/volume.h"

namespace usct::ros_interface {

us_ct_registration::CtVolume to_message(const CtVolume& ct, const std_msgs::Header& header,
                                        unsigned revision);
CtVolume from_message(const us_ct_registration::CtVolume& message, const std::string& source);

}  // namespace usct::ros_interface
