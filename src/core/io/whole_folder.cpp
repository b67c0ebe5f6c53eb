#include "us_ct_registration/io/whole_folder.h"

#include <unistd.h>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/temporary_path.h"

namespace usct {
namespace {

namespace fs = std::filesystem;

/// The path `folder` without a slash at its end ("out/" becomes "out").
fs::path without_trailing_slash(const fs::path& folder) {
  return folder.has_filename() ? folder : folder.parent_path();
}

fs::path parent_of(const fs::path& folder) {
  const fs::path parent = folder.parent_path();
  return parent.empty() ? fs::path(".") : parent;
}

}  // namespace

void require_new_folder(const fs::path& folder) {
  const fs::path target = without_trailing_slash(folder);
  std::error_code error;
  if (target.empty() || !fs::is_directory(parent_of(target), error))
    throw InputError(folder.string(), "the folder that it lies in does not exist");
  if (!fs::exists(fs::symlink_status(target, error))) return;
  if (!fs::is_directory(target, error) || !fs::is_empty(target, error) || error)
    throw InputError(folder.string(), "exists, must be absent or an empty folder");
}

void write_whole_folder(const fs::path& folder, const std::function<void(const fs::path&)>& write) {
  require_new_folder(folder);
  const fs::path target = without_trailing_slash(folder);
  const fs::path made =
      parent_of(target) / ("." + target.filename().string() + ".tmp-" + std::to_string(getpid()));
  std::error_code error;
  if (!fs::create_directory(made, error))
    throw InputError(folder.string(), "cannot be created: " + error.message());
  const TemporaryPath temporary(made);  // from here on: one that is there already is another's
  write(temporary.path());
  fs::rename(temporary.path(), target);
}

}  // namespace usct
