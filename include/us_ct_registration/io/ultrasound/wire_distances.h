#pragma once

#include <filesystem>
#include <optional>

#include "us_ct_registration/geometry/motor_calibration.h"

namespace usct {

/// Distances of N-wires as CSV: the header line `volume,frame,distance_mm`, then one line per pair
/// of wires found, both numbers counted from 0. Several lines of one volume and frame (several
/// pairs) are averaged; a frame without a line shows no wires. If `frames` is unset, a sweep has as
/// many frames as the largest number in the file requires.
///
/// Throws InputError, naming file and line, if the header differs, a line does not have three
/// numbers in range (frames below 100000), or there is no line.
WireDistances read_wire_distances(const std::filesystem::path& path, double true_distance_mm,
                                  std::optional<int> frames = {});

}  // namespace usct
