#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

namespace usct {

/// Writes a file so that `target` is at every moment either unchanged or complete.
///
/// `write` is given the path of a temporary file in the folder of `target`, whose name ends in the
/// whole name of `target` (writers that choose the format by the extension see the same one), and
/// creates it. The temporary is then flushed to disk and renamed to `target`. On any failure it is
/// removed, and `target` is untouched.
///
/// A link is followed: the file that it leads to is written.
///
/// Throws InputError, naming `target`, if its folder does not exist or cannot be written to, or if
/// `target` is there and no regular file (a folder, a device, a pipe); std::runtime_error if the
/// disk fails; and whatever `write` throws.
void write_atomically(const std::filesystem::path& target,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

/// Throws as `write_atomically` does if `target` cannot be written, before the work whose result it
/// will hold.
void require_writable(const std::filesystem::path& target);

/// Writes the whole content of `file`, the temporary file of `target`. Throws std::runtime_error,
/// naming `target` and the reason, if that fails, as on a full disk.
void write_content(const std::filesystem::path& file, std::string_view content,
                   const std::filesystem::path& target);

/// Writes a whole file of text in this way.
void write_text(const std::filesystem::path& target, std::string_view text);

/// The file that `path` leads to if it is a link, which need not exist; otherwise `path`.
std::filesystem::path behind_links(std::filesystem::path path);

}  // namespace usct
