#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {

/// A path that is not below the data root.
class PathRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The folder below which callers may have files opened or written. Callers may be told no path but
/// the one that they gave, and no name of a file or folder that they did not name, because many
/// such names are those of patients.
class DataRoot {
 public:
  /// Throws InputError, naming `parameter`, unless `root` is a folder.
  DataRoot(const std::filesystem::path& root, const std::string& parameter);

  /// The file or folder that `given` names, with all links resolved; a relative path begins at the
  /// root. Throws PathRefused, naming `field`, if the path is not below the root, whether or not it
  /// exists, or if a link leads out of the root: a link inside the folder or, for a file that is
  /// read together with others, beside the file. Throws InputError if nothing has that name.
  std::filesystem::path resolve(const std::string& given, const std::string& field) const;

  /// The file to write that `given` names, with the links of its folder resolved; a relative path
  /// begins at the root. Throws PathRefused, naming `field`, if it is not below the root.
  std::filesystem::path resolve_new(const std::string& given, const std::string& field) const;

 private:
  std::filesystem::path below(const std::string& given, const std::string& field) const;
  bool is_below(const std::filesystem::path& path) const;
  void require_no_link_out(const std::filesystem::path& folder, bool with_subfolders,
                           const std::string& field) const;

  std::filesystem::path root_;
  std::string parameter_;
};

/// A `text` about `path` that callers may read: it has `path` as the caller gave it, and numbers in
/// place of the names of files and folders in it or beside it.
std::string without_names(const std::string& text, const std::filesystem::path& path,
                          const std::string& given);

}  // namespace usct::ros_interface
