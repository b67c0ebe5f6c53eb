#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "io/bytes.h"

namespace usct::io {

/// The text before the data of a NRRD file.
struct NrrdHeader {
  std::map<std::string, std::string> fields;  // "type: unsigned char", names in lower case
  std::map<std::string, std::string> keys;    // "key:=value"
  std::size_t data_offset = 0;                // the first byte after the header

  /// Throws InputError if the field is missing.
  const std::string& field(const std::string& name, const std::string& source) const;
};

/// Reads the header of NRRD0001 to NRRD0005. Throws InputError, naming `source` and the line, for
/// another magic, a line of neither form, a field given twice, or a key with two values.
NrrdHeader parse_nrrd_header(const Bytes& bytes, const std::string& source);

}  // namespace usct::io
