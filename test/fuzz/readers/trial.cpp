#include "trial.h"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>
#include <set>
#include <stdexcept>

#include "core/io/temporary_folder.h"
#include "mutator.h"
#include "us_ct_registration/error.h"

namespace usct::fuzz {
namespace {

namespace fs = std::filesystem;
using io::Bytes;
using Clock = std::chrono::steady_clock;

constexpr int kMostFaults = 20;
constexpr std::size_t kLargestCorpus = 2000;

/// The memory by which the process that reads reports to the one that waits for it.
struct Shared {
  std::uint64_t runs = 0;
  std::uint64_t accepted = 0;
  std::uint64_t refusals = 0;
  double growth_mib = 0.0;
  int faults = 0;
  char texts[kMostFaults][400] = {};
};

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Memory of this process that is no file, MiB.
double own_memory_mib() {
  std::ifstream statm("/proc/self/statm");
  double size = 0.0;
  double resident = 0.0;
  double shared = 0.0;
  statm >> size >> resident >> shared;
  return (resident - shared) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

void write_file(const fs::path& path, const Bytes& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

/// A message without what is different in each: numbers, and what stands between quotes.
std::string kind_of(const std::string& message) {
  const std::size_t first = std::min(message.find_first_of("'\""), message.size());
  const std::size_t last = message.find_last_of("'\"");
  const std::string rest = last == std::string::npos ? "" : message.substr(last + 1);
  std::string kind;
  for (const char c : message.substr(0, first) + rest)
    if (std::isalpha(static_cast<unsigned char>(c)) != 0 || c == ' ') kind += c;
  return kind.substr(0, 100);
}

/// The work of one process: it reads file after file.
class Worker {
 public:
  Worker(const Reader& reader, const TrialOptions& options, const fs::path& folder, Shared& shared)
      : reader_(reader), options_(options), shared_(shared), folder_(folder) {
    path_ = folder_ / reader.file;
    for (const auto& [name, bytes] : reader.beside) write_file(folder_ / name, bytes);
  }

  void run(std::uint64_t seed, std::uint64_t runs, double seconds) {
    for (const Bytes& good : reader_.seeds) {
      write_file(path_, reader_.mended != nullptr ? reader_.mended(good) : good);
      if (const std::string refusal = outcome(); !refusal.empty())
        fault("refuses a good file: " + refusal);
    }
    shared_.accepted = 0;
    Mutator mutator(seed);
    const Clock::time_point begin = Clock::now();
    double memory_mib = 0.0;
    for (std::uint64_t i = 0; i < runs; ++i) {
      if (i % 64 == 0) {
        const double passed_s = seconds_since(begin);
        if (passed_s > seconds) break;
        if (memory_mib == 0.0 && (2 * i >= runs || 2.0 * passed_s > seconds))
          memory_mib = own_memory_mib();
      }
      Bytes bytes = mutator.mutated(corpus_, reader_.seeds.size());
      const bool mend = reader_.mended != nullptr && mutator.below(2) == 0;
      write_file(path_, mend ? reader_.mended(bytes) : bytes);
      ::alarm(options_.hang_s);
      // The corpus keeps what is to be mutated, not what was mended.
      if (is_new(outcome()) && corpus_.size() < kLargestCorpus && !bytes.empty())
        corpus_.push_back(std::move(bytes));
      ++shared_.runs;
    }
    ::alarm(0);
    if (memory_mib > 0.0) shared_.growth_mib = own_memory_mib() - memory_mib;
    shared_.refusals = kinds_.size();
  }

 private:
  /// Reads the file; returns the kind of the refusal, or "".
  std::string outcome() {
    try {
      reader_.read(path_);
      ++shared_.accepted;
      return "";
    } catch (const InputError& error) {
      const std::string message = error.what();
      if (message.find(folder_.string()) == std::string::npos)
        fault("an error that does not name the file: " + message);
      return kind_of(error.violation());
    } catch (const std::exception& error) {
      fault("an exception other than InputError: " + std::string(error.what()));
    } catch (...) {
      fault("an exception of an unknown type");
    }
    return "fault";
  }

  bool is_new(const std::string& kind) {
    return kind.empty() ? shared_.accepted % 64 == 1 : kinds_.insert(kind).second;
  }

  /// Faults of one kind are reported once.
  void fault(const std::string& text) {
    if (shared_.faults == kMostFaults || !kinds_.insert("fault " + kind_of(text)).second) return;
    std::strncpy(shared_.texts[shared_.faults], text.c_str(), sizeof(shared_.texts[0]) - 1);
    keep_file(shared_.faults++);
  }

  void keep_file(int number) const;

  const Reader& reader_;
  const TrialOptions& options_;
  Shared& shared_;
  fs::path folder_;
  fs::path path_;
  std::vector<Bytes> corpus_ = reader_.seeds;
  std::set<std::string> kinds_;
};

fs::path kept(const Reader& reader, const TrialOptions& options, const std::string& number) {
  std::string name = reader.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return options.keep / (name + "_" + number + "_" + reader.file);
}

void Worker::keep_file(int number) const {
  if (options_.keep.empty()) return;
  fs::copy_file(path_, kept(reader_, options_, std::to_string(number)),
                fs::copy_options::overwrite_existing);
}

/// Runs a worker in a process of its own. Returns how it died; "" if it did not.
std::string in_process(Worker& worker, const TrialOptions& options, std::uint64_t seed,
                       std::uint64_t runs, double seconds) {
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("cannot fork");
  if (child == 0) {
    worker.run(seed, runs, seconds);
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM)
    return "a hang of more than " + std::to_string(options.hang_s) + " s";
  if (WIFSIGNALED(status)) return "a crash: " + std::string(::strsignal(WTERMSIG(status)));
  return "the process ended with " + std::to_string(WEXITSTATUS(status));
}

}  // namespace

Trial run_trial(const Reader& reader, const TrialOptions& options) {
  const test::TemporaryFolder folder;
  void* memory =
      ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory");
  Shared& shared = *new (memory) Shared;
  Worker worker(reader, options, folder.path(), shared);

  Trial trial;
  const Clock::time_point begin = Clock::now();
  for (std::uint64_t seed = options.seed; shared.runs < options.runs; ++seed) {
    const double left_s = options.seconds - seconds_since(begin);
    if (left_s <= 0.0 || trial.faults.size() >= kMostFaults) break;
    const std::string death = in_process(worker, options, seed, options.runs - shared.runs, left_s);
    if (death.empty()) break;
    trial.faults.push_back(death);
    ++shared.runs;
    if (!options.keep.empty())
      fs::copy_file(folder.path() / reader.file,
                    kept(reader, options, "dead_" + std::to_string(seed)),
                    fs::copy_options::overwrite_existing);
  }
  trial.seconds = seconds_since(begin);
  trial.runs = shared.runs;
  trial.accepted = shared.accepted;
  trial.refusals = shared.refusals;
  trial.growth_mib = shared.growth_mib;
  for (int i = 0; i < shared.faults; ++i) trial.faults.emplace_back(shared.texts[i]);
  if (trial.growth_mib > options.leak_mib)
    trial.faults.push_back("memory grew by " + std::to_string(trial.growth_mib) +
                           " MiB in the second half of the runs");
  ::munmap(memory, sizeof(Shared));
  return trial;
}

}  // namespace usct::fuzz
