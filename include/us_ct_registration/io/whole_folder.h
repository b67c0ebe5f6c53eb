#pragma once

#include <filesystem>
#include <functional>

/// Folders of several files that are complete or absent.
namespace usct {

/// Throws InputError, naming `folder`, unless it is absent or empty and lies in a folder that
/// exists.
void require_new_folder(const std::filesystem::path& folder);

/// Makes `folder` with what `write` puts into the temporary folder whose path it is given. On any
/// failure nothing of it is left. Throws InputError as `require_new_folder` or if the folder cannot
/// be made, and whatever `write` throws.
void write_whole_folder(const std::filesystem::path& folder,
                        const std::function<void(const std::filesystem::path& temporary)>& write);

}  // namespace usct
