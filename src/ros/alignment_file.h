#pragma once

#include <filesystem>
#include <optional>

#include "ros/alignment_decisions.h"

/// What tf_publisher keeps over a restart, as JSON; docs/nodes/tf_publisher.md has the keys.
namespace usct::ros_interface {

/// Nothing if there is no such file. Throws InputError, naming the file, for one that is cut off,
/// was changed by hand (it holds a checksum of its content), or has no rigid transform.
StoredAlignment read_alignment(const std::filesystem::path& path);

/// Atomic. Throws InputError if the folder does not exist or cannot be written to.
void write_alignment(const StoredAlignment& stored, const std::filesystem::path& path);

}  // namespace usct::ros_interface
