#pragma once

#include <us_ct_registration/ProbeGeometry.h>

#include <string>

#include "us_ct_registration/geometry/scan_geometry.h"

/// The array of a probe and the samples along its lines.
namespace usct::ros_interface {

bool is_motorised(const us_ct_registration::ProbeGeometry& message);

/// The message has the radius of the motor; motor angles or poses are in the message around it.
us_ct_registration::ProbeGeometry to_probe_message(const ScanGeometry& geometry);

/// `lines` is the number of lines that the message with this geometry states.
Array array_from_message(const us_ct_registration::ProbeGeometry& message, std::uint32_t lines,
                         const std::string& source);
AxialSampling axial_from_message(const us_ct_registration::ProbeGeometry& message,
                                 std::uint32_t samples, const std::string& source);

/// Throws InputError if a field is set that probes of the message's type do not have: its value
/// would be lost.
void require_unused(const char* name, bool unused, const std::string& source);

}  // namespace usct::ros_interface
