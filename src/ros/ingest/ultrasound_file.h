#pragma once

#include <ros/time.h>
#include <us_ct_registration/PreScanVolume.h>

#include <string>
#include <vector>

#include "ros/parameters.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::ros_interface {

/// Reads an ISO 8601 time in UTC, `YYYY-MM-DDThh:mm:ss[.fraction]Z`. Throws InputError, naming
/// `source`, for any other text and for years outside 1970-2105.
::ros::Time time_from_utc(const std::string& text, const std::string& source);

/// The file and its options, from the parameters `path` and those of the table of options
/// (ultrasound_source.h). Throws InputError as Parameters, and if options contradict each other.
UltrasoundSource read_ultrasound_source(Parameters& parameters);

/// Origin of the stamp of a volume from a file.
enum class FileStamp {
  kAcquisition,  // the file's own acquisition time; a file without one is refused
  kReading,      // the time at which the file is read
};

/// Reads a file of pre-scan ultrasound as a message, and adds the reader's warnings to `warnings`.
/// Throws InputError as `read_ultrasound`, and for files that hold no pre-scan volume (B-mode
/// images without a probe, Cartesian volumes).
us_ct_registration::PreScanVolumePtr read_volume_message(const UltrasoundSource& source,
                                                         const std::string& frame_id,
                                                         FileStamp stamp, const ::ros::Time& now,
                                                         std::vector<std::string>& warnings);

}  // namespace usct::ros_interface
