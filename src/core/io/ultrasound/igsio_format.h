#pragma once

#include <functional>
#include <string>

#include "io/bytes.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

/// Parses and writes the format of igsio.h in memory. No files are opened, so that the parser can
/// be fuzzed.
namespace usct::io {

/// Returns the bytes of the detached data file of this name.
using ReadDetached = std::function<Bytes(const std::string& name)>;

IgsioSequence parse_igsio(Bytes bytes, const std::string& source,
                          const ReadDetached& read_detached);

Bytes format_igsio(const IgsioSequence& sequence, bool compressed, const std::string& source);

/// Parses 16 numbers, row by row. Throws InputError, naming `field`, unless they are finite and the
/// last row is 0 0 0 1.
Eigen::Affine3d parse_affine(std::string_view text, const std::string& source,
                             const std::string& field);

}  // namespace usct::io
