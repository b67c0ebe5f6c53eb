#include "ros/ingest/watched_folder.h"

#include <algorithm>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;

bool ends_with(const std::string& text, const std::string& suffix) {
  return text.size() >= suffix.size() &&
         text.compare(text.size() - suffix.size(), suffix.size(), suffix) == 0;
}

}  // namespace

WatchedFolder::WatchedFolder(const fs::path& folder, const std::string& suffix, double settle_s,
                             bool take_existing, double now_s)
    : folder_(folder), suffix_(suffix), settle_s_(settle_s) {
  files_ = look(now_s);
  for (auto& [path, file] : files_) file.taken = !take_existing;
  passed_over_ = take_existing ? 0 : files_.size();
}

std::map<fs::path, WatchedFolder::File> WatchedFolder::look(double now_s) const {
  std::map<fs::path, File> found;
  std::error_code error;
  fs::directory_iterator entry(folder_, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.front() == '.' || !ends_with(name, suffix_)) continue;
    // A file may vanish between one call and the next; it is then ignored.
    std::error_code vanished;
    if (!entry->is_regular_file(vanished)) continue;
    File file;
    file.size = entry->file_size(vanished);
    if (!vanished) file.changed = entry->last_write_time(vanished);
    file.unchanged_since_s = now_s;
    if (!vanished) found[entry->path()] = file;
  }
  if (error) throw InputError(folder_.string(), "the folder cannot be read: " + error.message());
  return found;
}

std::vector<fs::path> WatchedFolder::take(double now_s) {
  std::map<fs::path, File> found = look(now_s);
  std::vector<std::pair<fs::file_time_type, fs::path>> ready;
  for (auto& [path, file] : found) {
    const auto known = files_.find(path);
    if (known != files_.end() && known->second.size == file.size &&
        known->second.changed == file.changed)
      file = known->second;
    if (file.taken || now_s - file.unchanged_since_s < settle_s_) continue;
    file.taken = true;
    ready.emplace_back(file.changed, path);
  }
  // A share that drops out, or a file that another program replaces, is absent for a while.
  for (const auto& [path, file] : files_)
    if (file.taken) found.emplace(path, file);
  files_ = std::move(found);
  std::sort(ready.begin(), ready.end());
  std::vector<fs::path> paths;
  paths.reserve(ready.size());
  for (const auto& [changed, path] : ready) paths.push_back(path);
  return paths;
}

}  // namespace usct::ros_interface
