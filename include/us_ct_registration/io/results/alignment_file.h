#pragma once

#include <filesystem>

#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct {

/// Reads the alignment that was kept over a restart, from JSON; docs/nodes/tf_publisher.md explains
/// the keys. Empty if there is no such file. Throws InputError, naming the file, if it is cut off,
/// was changed by hand (it holds a checksum of its content), or has no rigid transform.
StoredAlignment read_alignment(const std::filesystem::path& path);

/// Writes atomically. Throws InputError if the folder does not exist or cannot be written to.
void write_alignment(const StoredAlignment& stored, const std::filesystem::path& path);

}  // namespace usct
