#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace usct::ros_interface {

/// Finds the files that appear in a folder, each once, when it is completely written. A file counts
/// as written when its size and time of change have stayed the same for `settle_s`; a file that
/// changes after it was taken is a new file; one that was absent for a while is not. Hidden files,
/// which atomic writers use, are ignored.
class WatchedFolder {
 public:
  /// Looks only at files whose names end in `suffix`. Files that are there already count as taken
  /// unless `take_existing`. Throws InputError if the folder cannot be read.
  WatchedFolder(const std::filesystem::path& folder, const std::string& suffix, double settle_s,
                bool take_existing, double now_s);

  /// Returns the files that are ready and counts them as taken; the file that changed first comes
  /// first. `now_s` must not fall from call to call. Throws InputError if the folder cannot be
  /// read.
  std::vector<std::filesystem::path> take(double now_s);

  /// Number of the files that were there already and counted as taken.
  std::size_t passed_over() const { return passed_over_; }

 private:
  struct File {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type changed;
    double unchanged_since_s = 0.0;
    bool taken = false;
  };

  std::map<std::filesystem::path, File> look(double now_s) const;

  std::filesystem::path folder_;
  std::string suffix_;
  double settle_s_;
  std::size_t passed_over_ = 0;
  std::map<std::filesystem::path, File> files_;
};

}  // namespace usct::ros_interface
