#include "us_ct_registration/io/temporary_path.h"

#include <mutex>
#include <set>
#include <system_error>

namespace usct {
namespace {

namespace fs = std::filesystem;

struct Registry {
  std::mutex mutex;
  std::set<fs::path> paths;
};

/// It outlives all static objects: a signal may come while these are destroyed.
Registry& registry() {
  static Registry& only = *new Registry;
  return only;
}

void remove_all_of(const fs::path& path) {
  std::error_code ignored;
  fs::remove_all(path, ignored);
}

}  // namespace

TemporaryPath::TemporaryPath(fs::path path) : path_(std::move(path)) {
  const std::lock_guard<std::mutex> lock(registry().mutex);
  registry().paths.insert(path_);
}

TemporaryPath::~TemporaryPath() {
  const std::lock_guard<std::mutex> lock(registry().mutex);
  remove_all_of(path_);
  registry().paths.erase(path_);
}

void remove_temporary_paths() {
  const std::lock_guard<std::mutex> lock(registry().mutex);
  for (const fs::path& path : registry().paths) remove_all_of(path);
}

}  // namespace usct
