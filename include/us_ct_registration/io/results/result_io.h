#pragma once

#include <filesystem>
#include <string>

#include "us_ct_registration/registration/registration_result.h"

/// Results of registrations as JSON. Keys: `status`, `message`, `T_us_ct` (16 numbers, row by row,
/// mm), `similarity`, `overlap`, `covariance` (36 numbers, row by row, of the motion
/// `p_us -> p_us + w x p_us + t` about the origin of the US frame, in the order w rad, t mm),
/// `candidates` (objects with `T_us_ct`, `similarity`, `overlap`), `measures` (numbers by name:
/// see Measures), `evaluations`, `seconds` (by stage), `options` (by name, as text), `version`.
/// Unknown values are null; `T_us_ct` is null unless status is "registered".
namespace usct {

/// Throws InputError, naming file and key: for a file that is not such JSON; for a key that is
/// missing, unknown or of the wrong type; for a transform that is not rigid; for a registered
/// result without transform, or a transform with any other status.
RegistrationResult read_result(const std::filesystem::path& path);

/// The text of such a file. Throws InputError for a result that `read_result` would refuse.
std::string result_json(const RegistrationResult& result, const std::string& source = "result");

/// Writes atomically. Reading gives the same numbers bit by bit. Throws InputError for a result
/// that `read_result` would refuse, or if the folder cannot be written to.
void write_result(const RegistrationResult& result, const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_result(const std::filesystem::path& path);

}  // namespace usct
