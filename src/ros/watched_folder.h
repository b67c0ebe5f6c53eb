#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace usct::ros_interface {

/// The files that appear in a folder, each once, when they are written to their end. A file counts
/// as written when its size and time of change have stayed the same for `settle_s`; one that
/// changes after it was taken is a new file. Hidden files (temporaries of atomic writers) are not
/// looked at.
class WatchedFolder {
 public:
  /// Only files whose names end in `suffix`. Those that are there already count as taken unless
  /// `take_existing`. Throws InputError if the folder cannot be read.
  WatchedFolder(const std::filesystem::path& folder, const std::string& suffix, double settle_s,
                bool take_existing, double now_s);

  /// The files to take, the one that changed first at the front. `now_s` must not fall from call to
  /// call. Throws InputError if the folder cannot be read.
  std::vector<std::filesystem::path> take(double now_s);

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
  std::map<std::filesystem::path, File> files_;
};

}  // namespace usct::ros_interface
