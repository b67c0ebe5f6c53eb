#pragma once

#include <ros/time.h>
#include <us_ct_registration/PreScanVolume.h>

#include <string>
#include <vector>

#include "ros/node/parameters.h"
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

/// Names what a volume waits for before it can be stamped, in words; empty if it can be stamped
/// `now`. Simulated time is 0 before it begins, which is no valid stamp, and all frames of the
/// sweep, which took `sweep_s`, need one.
std::string awaited(FileStamp stamp, const ::ros::Time& now, double sweep_s);

/// The time between the first frame and the last one, s; 0 if the file does not tell.
double sweep_seconds(const PreScanVolume& volume);

/// Reads a file of pre-scan ultrasound, and adds the reader's warnings to `warnings`. Throws
/// InputError as `read_ultrasound`, and for files that hold no pre-scan volume (B-mode images
/// without a probe, Cartesian volumes).
PreScanVolume read_prescan_file(const UltrasoundSource& source, std::vector<std::string>& warnings);

/// The volume of the file `source` as a message. Throws InputError if it has no acquisition time
/// but needs one, or if that is ahead of `now`, and std::runtime_error if a frame would be stamped
/// before 1970.
us_ct_registration::PreScanVolumePtr stamped_message(const PreScanVolume& volume,
                                                     const std::string& frame_id, FileStamp stamp,
                                                     const ::ros::Time& now,
                                                     const std::string& source);

}  // namespace usct::ros_interface
