#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/error.h"

/// Checks of messages that come from outside, before anything is allocated for them. Each throws an
/// InputError that names `source`, the field, its value and the constraint.
namespace usct::ros_interface {

inline void require(bool fulfilled, const std::string& source, const std::string& violation) {
  if (!fulfilled) throw InputError(source, violation);
}

void require_count(const char* name, std::size_t count, std::size_t wanted,
                   const std::string& source);

/// The product of the sizes must be the number of values in `data`. The data have already been
/// received, so that an absurd size is found here and not by a failing allocation.
void require_size(std::initializer_list<std::pair<const char*, std::uint32_t>> sizes,
                  std::size_t data, const std::string& source);

/// zlib's CRC-32 of the bytes of `data`.
template <typename T>
std::uint32_t checksum(const std::vector<T>& data);

void require_checksum(std::uint32_t found, std::uint32_t expected, const std::string& source);

}  // namespace usct::ros_interface
