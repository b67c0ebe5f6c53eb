#include "us_ct_registration/io/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/temporary_path.h"

namespace usct {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& target) {
  return target.has_parent_path() ? target.parent_path() : fs::path(".");
}

fs::path temporary_path(const fs::path& target) {
  static std::atomic<unsigned> counter{0};
  return folder_of(target) / (".tmp-" + std::to_string(::getpid()) + "-" +
                              std::to_string(++counter) + "-" + target.filename().string());
}

void check_target(const fs::path& target) {
  const fs::path folder = folder_of(target);
  std::error_code error;
  if (!target.has_filename() || fs::is_directory(target, error))
    throw InputError(target.string(), "is a folder, must be the name of a file");
  // A rename would take the place of a device or a pipe, for all programs.
  const fs::file_status status = fs::status(target, error);
  if (status.type() == fs::file_type::none)
    throw InputError(target.string(), "cannot be written: " + error.message());
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw InputError(target.string(), "is not a regular file, must be one or not exist");
  if (!fs::is_directory(folder, error))
    throw InputError(target.string(), "folder '" + folder.string() + "' does not exist");
}

/// Throws InputError unless a file can be created in the folder. Only an attempt shows that:
/// permissions, access lists and read-only mounts can all prevent it.
void check_folder_is_writable(const fs::path& target, const fs::path& temporary) {
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0)
    throw InputError(target.string(), "folder '" + folder_of(target).string() +
                                          "' cannot be written to: " + std::strerror(errno));
  ::close(file);
  ::unlink(temporary.c_str());
}

/// Flushes a file or folder. Without this, a crash after the rename could leave an empty file under
/// the final name.
void flush_to_disk(const fs::path& path, int flags, const fs::path& target) {
  const int file = ::open(path.c_str(), flags | O_CLOEXEC);
  if (file < 0) throw std::runtime_error(target.string() + ": " + std::strerror(errno));
  const int status = ::fsync(file);
  const int failure = errno;
  ::close(file);
  if (status != 0 && failure != EINVAL)  // EINVAL: a file system that cannot be flushed
    throw std::runtime_error(target.string() + ": flush failed: " + std::strerror(failure));
}

}  // namespace

fs::path behind_links(fs::path path) {
  constexpr int kMostLinks = 40;  // as Linux
  for (int i = 0; i < kMostLinks && fs::is_symlink(fs::symlink_status(path)); ++i)
    path = folder_of(path) / fs::read_symlink(path);
  return path;
}

void require_writable(const fs::path& named) {
  const fs::path target = behind_links(named);
  check_target(target);
  check_folder_is_writable(target, temporary_path(target));
}

void write_atomically(const fs::path& named,
                      const std::function<void(const fs::path& temporary)>& write) {
  // A rename would take the place of a link, and leave its file as it was.
  const fs::path target = behind_links(named);
  check_target(target);
  const fs::path folder = folder_of(target);
  const TemporaryPath temporary(temporary_path(target));
  check_folder_is_writable(target, temporary.path());
  write(temporary.path());
  flush_to_disk(temporary.path(), O_RDONLY, target);
  std::error_code error;
  fs::rename(temporary.path(), target, error);
  if (error) throw std::runtime_error(target.string() + ": rename failed: " + error.message());
  flush_to_disk(folder, O_RDONLY | O_DIRECTORY, target);
}

void write_content(const fs::path& file, std::string_view content, const fs::path& target) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream)
    throw std::runtime_error(target.string() + ": writing failed: " + std::strerror(errno));
}

void write_text(const fs::path& target, std::string_view text) {
  write_atomically(target,
                   [&](const fs::path& temporary) { write_content(temporary, text, target); });
}

}  // namespace usct
