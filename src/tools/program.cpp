#include "program.h"

#include <cstdio>
#include <exception>
#include <stdexcept>

#include "exit_status.h"
#include "us_ct_registration/error.h"

namespace usct::tools {
namespace {

int parse_and_run(CLI::App& app, const Run& run, int argc, char** argv) {
  app.set_version_flag("--version", USCT_VERSION);
  app.require_subcommand(1);
  app.footer("Exit status: 0 done, 1 failed, 2 bad arguments or input, 3 registration refused.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return kBadInput;
  }
  const int status = run();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    throw std::runtime_error("standard output cannot be written to");
  return status;
}

}  // namespace

int run_program(CLI::App& app, const Run& run, int argc, char** argv) {
  try {
    return parse_and_run(app, run, argc, argv);
  } catch (const InputError& error) {
    std::fprintf(stderr, "usct: error: %s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "usct: failed: %s\n", error.what());
    return kFailed;
  }
}

}  // namespace usct::tools
