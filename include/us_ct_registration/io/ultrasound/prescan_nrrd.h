#pragma once

#include <filesystem>
#include <string>

#include "us_ct_registration/ultrasound/prescan_volume.h"

/// The project's own file of pre-scan ultrasound: a NRRD of `unsigned char`, three axes samples x
/// lines x frames (samples fastest), with the geometry in key/value pairs (`key:=value`), in
/// millimetres and degrees:
///
/// | key | meaning |
/// |---|---|
/// | `usct_geometry` | `motorised_curvilinear`, `tracked_curvilinear` or `tracked_linear` |
/// | `start_depth_mm`, `sample_spacing_mm` | first sample below the array's surface; pitch |
/// | `probe_radius_mm` | curvilinear |
/// | `line_angles_deg` or `line_pitch_deg` | curvilinear: one per line, or evenly, centred on 0 |
/// | `line_positions_mm` | linear: one per line |
/// | `motor_radius_mm` | motorised |
/// | `frame_angles_deg` or `frame_pitch_deg` | motorised: one per frame, or evenly, centred on 0 |
/// | `frame_travel_deg` | motorised: motor travel during one frame; 0 if absent |
/// | `frame_poses_mm` | tracked: 12 numbers per frame (3x4, row-major), frames split by `;` |
/// | `frame_times_s` | tracked, optional: one per frame |
/// | `acquisition_time` | optional: ISO 8601 in UTC, for example 2024-05-17T09:30:00Z |
///
/// Reading gives values in millimetres and seconds bit by bit, and angles, which pass through
/// degrees, within two units in the last place.
namespace usct {

/// Whether the file is a NRRD with the key `usct_geometry`. False for anything else, also for a
/// file that cannot be opened.
bool is_prescan_nrrd(const std::filesystem::path& path);

/// Reads NRRD0001 to NRRD0005, raw or gzip, data attached or in one file in the same folder.
///
/// Throws InputError, naming file, field and constraint: for anything that is not such a file; for
/// sizes that do not fit the data; for a geometry key that is missing, given twice, contradicted (a
/// table and a pitch), of another kind of geometry, or unknown (any key that starts with `usct_` or
/// ends in a unit); and for what ScanGeometry::validate refuses.
PreScanVolume read_prescan_nrrd(const std::filesystem::path& path);

/// Writes atomically, gzip, data attached. Throws InputError if the volume is invalid or the folder
/// cannot be written to.
void write_prescan_nrrd(const PreScanVolume& volume, const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_prescan_nrrd(const std::filesystem::path& path);

}  // namespace usct
