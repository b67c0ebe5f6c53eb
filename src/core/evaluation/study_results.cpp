#include "evaluation/study_results.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <unordered_map>

#include "evaluation/fingerprint.h"
#include "evaluation/study_run_json.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using io::Json;

const std::string kChecksumKey = ",\"checksum\":\"";
constexpr std::size_t kDigits = 16;

std::string checksum_of(const std::string& text) {
  Fingerprint print;
  print.add(text);
  return print.text();
}

/// `{"fingerprint":"...","run":{...},"checksum":"..."}`; the checksum is that of the text before
/// its key.
std::string line_of(const StudyRun& run, const std::string& fingerprint) {
  const Json json{{"fingerprint", fingerprint}, {"run", run_json(run)}};
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.pop_back();
  return text + kChecksumKey + checksum_of(text) + "\"}";
}

/// The object of a line, or the reason why it is not one.
Json parse_line(const std::string& line, const std::string& source) {
  const std::size_t tail = kChecksumKey.size() + kDigits + 2;
  const std::size_t body = line.size() < tail ? 0 : line.size() - tail;
  if (body == 0 || line.compare(body, kChecksumKey.size(), kChecksumKey) != 0)
    throw InputError(source, "is not a whole result");
  const std::string text = line.substr(0, body);
  if (line.substr(body + kChecksumKey.size(), kDigits) != checksum_of(text))
    throw InputError(source, "does not have the checksum that it states");
  try {
    return io::parse_json<Json>(text + "}", source);
  } catch (const Json::exception& error) {
    throw InputError(source, std::string("is not JSON: ") + error.what());
  }
}

/// An open file with an exclusive lock, which other processes of this machine and, on a network
/// file system, of other machines wait for.
class LockedFile {
 public:
  explicit LockedFile(const fs::path& path)
      : path_(path), file_(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0666)) {
    if (file_ < 0) fail();
    while (::flock(file_, LOCK_EX) != 0)
      if (errno != EINTR) fail();
  }
  ~LockedFile() { ::close(file_); }
  LockedFile(const LockedFile&) = delete;
  LockedFile& operator=(const LockedFile&) = delete;

  bool ends_within_line() const {
    const off_t size = ::lseek(file_, 0, SEEK_END);
    char last = '\n';
    if (size > 0 && ::pread(file_, &last, 1, size - 1) != 1) fail_to_write();
    return last != '\n';
  }
  void append(const std::string& text) const {
    for (std::size_t begin = 0; begin < text.size();) {
      const ssize_t written = ::write(file_, text.data() + begin, text.size() - begin);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail_to_write();
      begin += static_cast<std::size_t>(written);
    }
    // EINVAL: a file system that cannot be flushed.
    if (::fdatasync(file_) != 0 && errno != EINVAL) fail_to_write();
  }

 private:
  [[noreturn]] void fail() const {
    throw InputError(path_.string(), std::string("cannot be written to: ") + std::strerror(errno));
  }

  /// As where a disk is full, which is no fault of the arguments.
  [[noreturn]] void fail_to_write() const {
    throw std::runtime_error(path_.string() + ": writing failed: " + std::strerror(errno));
  }

  fs::path path_;
  int file_;
};

std::vector<fs::path> result_files(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::is_directory(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".jsonl") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

void append_result(const fs::path& file, const StudyRun& run, const std::string& fingerprint) {
  const std::string line = line_of(run, fingerprint) + "\n";
  const LockedFile locked(file);
  locked.append(locked.ends_within_line() ? "\n" + line : line);
}

std::vector<std::optional<StudyRun>> read_results(
    const fs::path& folder, const StudyPlan& plan,
    const std::function<void(const std::string&)>& warn) {
  // Methods with the same options have the same fingerprints, and share results.
  std::unordered_map<std::string, std::vector<std::size_t>> indices_of;
  for (std::size_t i = 0; i < plan.runs.size(); ++i)
    indices_of[plan.runs[i].fingerprint].push_back(i);
  std::vector<std::optional<StudyRun>> runs(plan.runs.size());
  for (const fs::path& file : result_files(folder)) {
    std::ifstream text(file);
    std::size_t foreign = 0;
    std::string line;
    for (int number = 1; std::getline(text, line); ++number) {
      const std::string source = file.string() + ": line " + std::to_string(number);
      try {
        const Json json = parse_line(line, source);
        const io::Members members(json, source, {"fingerprint", "run"});
        const auto found = indices_of.find(members.text("fingerprint"));
        if (found == indices_of.end()) {
          ++foreign;
          continue;
        }
        for (const std::size_t i : found->second)
          if (!runs[i]) runs[i] = run_from_json(members.at("run"), plan, i, source);
      } catch (const InputError& error) {
        if (warn) warn(std::string(error.what()) + "; its run is made again");
      }
    }
    if (foreign > 0 && warn)
      warn(file.string() + ": " + std::to_string(foreign) +
           " lines are of other runs than this study has now (other cases, starts, options or "
           "version), and are not used");
  }
  return runs;
}

}  // namespace usct
