#include "program.h"

#include <pthread.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <thread>
#include <vector>

#include "exit_status.h"
#include "option_keys.h"
#include "parse_errors.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/temporary_path.h"

namespace usct::tools {
namespace {

const CLI::App& known_subcommand(const CLI::App& app, const std::string& name) {
  std::string known;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->check_name(name)) return *sub;
    if (!sub->get_name().empty()) known += (known.empty() ? "" : ", ") + sub->get_name();
  }
  throw InputError("subcommand", "is '" + name + "', must be one of " + known);
}

/// CLI11 says of a subcommand that it does not know that one is required.
void require_known_subcommands(const CLI::App& app, char** names, char** end) {
  if (app.get_require_subcommand_min() == 0 || names == end) return;
  const std::string name = *names;
  if (name.empty() || name.front() == '-') return;
  require_known_subcommands(known_subcommand(app, name), names + 1, end);
}

/// All options that the command line gives.
void add_given(const CLI::App& app, std::vector<const CLI::Option*>& given) {
  for (const CLI::Option* option : app.get_options())
    if (option->count() > 0) given.push_back(option);
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    add_given(*sub, given);
}

/// The ranges of CLI11 let "nan" pass, which would then switch an option off without a word.
void require_finite_numbers(const CLI::App& app) {
  std::vector<const CLI::Option*> given;
  add_given(app, given);
  for (const CLI::Option* option : given) {
    if (option->get_type_name().rfind("FLOAT", 0) != 0) continue;
    for (const std::string& result : option->results()) {
      char* end = nullptr;
      const double value = std::strtod(result.c_str(), &end);
      if (*end == '\0' && !std::isfinite(value))
        throw InputError(option->get_name(), "is '" + result + "', must be finite");
    }
  }
}

/// A file that is written must be none that is read, and no other that is written.
void require_outputs_apart(const CLI::App& app) {
  namespace fs = std::filesystem;
  std::vector<const CLI::Option*> given;
  add_given(app, given);
  const auto require_apart = [](const CLI::Option& output, const CLI::Option& other) {
    std::error_code ignored;  // of names that cannot be those of files
    const fs::path written = fs::weakly_canonical(output.results().front(), ignored);
    for (const std::string& name : other.results()) {
      const bool may_be_file = is_written(other) || fs::is_regular_file(name, ignored);
      if (may_be_file && !written.empty() && fs::weakly_canonical(name, ignored) == written)
        throw InputError(output.get_name(), "is '" + output.results().front() + "', the file of " +
                                                other.get_name() + ", must be another");
    }
  };
  for (const CLI::Option* output : given)
    for (const CLI::Option* other : given)
      if (is_written(*output) && other != output) require_apart(*output, *other);
}

/// `nohup` and shells in the background have signals ignored. Waiting for one would still get it.
bool is_ignored(int signal) {
  struct sigaction action = {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

/// A program that Ctrl-C, a scheduler or a closed terminal ends leaves no temporary files behind. A
/// thread of its own waits for the signal, since a handler could call hardly anything.
void leave_nothing_behind() {
  sigset_t ends;
  sigemptyset(&ends);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (!is_ignored(signal)) sigaddset(&ends, signal);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);  // for all threads that start later as well
  std::thread([ends] {
    int signal = 0;
    if (sigwait(&ends, &signal) != 0) return;
    remove_temporary_paths();
    std::signal(signal, SIG_DFL);
    pthread_sigmask(SIG_UNBLOCK, &ends, nullptr);
    std::raise(signal);
  }).detach();
}

int parse_and_run(CLI::App& app, const Run& run, int argc, char** argv) {
  app.set_version_flag("--version", USCT_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 done, 1 the program or the machine failed, 2 bad arguments or input, 3 not "
      "registered.");
  require_known_subcommands(app, argv + 1, argv + argc);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "usct: error: %s\n", refusal_of(app, error).c_str());
    return kBadInput;
  }
  require_finite_numbers(app);
  require_outputs_apart(app);
  const int status = run();
  require_printed();
  return status;
}

}  // namespace

void require_printed() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    throw std::runtime_error("standard output cannot be written to");
}

int run_program(CLI::App& app, const Run& run, int argc, char** argv) {
  leave_nothing_behind();
  try {
    return parse_and_run(app, run, argc, argv);
  } catch (const InputError& error) {
    std::fprintf(stderr, "usct: error: %s\n", with_option_names(app, error).c_str());
    return kBadInput;
  } catch (const std::filesystem::filesystem_error& error) {  // such as a folder nobody may read
    std::fprintf(stderr, "usct: error: %s: %s\n", error.path1().c_str(),
                 error.code().message().c_str());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "usct: failed: %s\n", error.what());
    return kFailed;
  }
}

}  // namespace usct::tools
