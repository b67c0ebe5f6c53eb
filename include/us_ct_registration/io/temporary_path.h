#pragma once

#include <filesystem>

namespace usct {

/// The path of a file or folder that is removed, if there is one, when this object is destroyed.
class TemporaryPath {
 public:
  explicit TemporaryPath(std::filesystem::path path);
  ~TemporaryPath();
  TemporaryPath(const TemporaryPath&) = delete;
  TemporaryPath& operator=(const TemporaryPath&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Removes what is at the paths of all these objects: for a program that ends without destroying
/// them, because a signal asks it to.
void remove_temporary_paths();

}  // namespace usct
