#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

/// Points as CSV: the header line `x,y,z`, then one point per line, in millimetres.
namespace usct {

/// Throws InputError, naming file and line, if the header differs, a line does not have three
/// finite numbers, or there is no point.
std::vector<Eigen::Vector3d> read_points_mm(const std::filesystem::path& path);

/// Writes atomically. Reading gives the same numbers bit by bit. Throws InputError if there is no
/// point or one is not finite.
void write_points_mm(const std::vector<Eigen::Vector3d>& points_mm,
                     const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_points(const std::filesystem::path& path);

}  // namespace usct
