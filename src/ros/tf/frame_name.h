#pragma once

#include <string>

namespace usct::ros_interface {

/// The name of a tf frame as tf2 has it, which takes a name with and without a leading slash for
/// the same frame.
inline std::string frame_name(const std::string& name) {
  return !name.empty() && name.front() == '/' ? name.substr(1) : name;
}

}  // namespace usct::ros_interface
