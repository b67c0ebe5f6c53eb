#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {

/// Not below the data root.
class PathRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The folder that callers may have files opened below, and what they may be told of it: no path
/// but the one they gave, and no name of a file or folder that they did not name (many name a
/// patient).
class DataRoot {
 public:
  /// Throws InputError, naming `parameter`, unless `root` is a folder.
  DataRoot(const std::filesystem::path& root, const std::string& parameter);

  /// The file or folder that `given` names (relative: below the root), with all links resolved.
  /// Throws PathRefused, naming `field`, if that, or what a link in it (or, for a file of several,
  /// beside it) leads to, is not below the root, whether or not it exists; InputError if there is
  /// nothing of that name.
  std::filesystem::path resolve(const std::string& given, const std::string& field) const;

 private:
  bool is_below(const std::filesystem::path& path) const;
  void require_no_link_out(const std::filesystem::path& folder, bool with_subfolders,
                           const std::string& field) const;

  std::filesystem::path root_;
};

/// `text` about `path` for people: `path` as the caller gave it, and names of files and folders in
/// it, or beside it, by their number.
std::string without_names(const std::string& text, const std::filesystem::path& path,
                          const std::string& given);

}  // namespace usct::ros_interface
