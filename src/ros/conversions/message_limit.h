#pragma once

#include <cstdint>

namespace usct::ros_interface {

/// roscpp closes a connection, for ever, on which a message of more than 1e9 bytes arrives. So much
/// may be the bulk of one, beside its other fields.
constexpr std::uint64_t kMostMessageBytes = 950'000'000;

}  // namespace usct::ros_interface
