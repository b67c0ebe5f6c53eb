#include <cstdio>
#include <exception>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/error.h"

namespace usct::tools {
namespace {

int parse_and_run(int argc, char** argv) {
  CLI::App app{"usct: registration of preoperative CT to 3D ultrasound of the kidney"};
  app.set_version_flag("--version", USCT_VERSION);
  app.require_subcommand(1);
  app.footer("Exit status: 0 done, 1 failed, 2 bad arguments or input, 3 registration refused.");
  Run run;
  add_info_command(app, run);
  add_convert_command(app, run);
  add_slices_command(app, run);
  add_calibrate_motor_command(app, run);
  add_lag_command(app, run);
  add_phantom_command(app, run);
  add_simulate_command(app, run);
  add_register_command(app, run);
  add_presets_command(app, run);
  add_evaluate_command(app, run);
  add_study_command(app, run);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return kBadInput;
  }
  return run();
}

}  // namespace
}  // namespace usct::tools

int main(int argc, char** argv) {
  try {
    return usct::tools::parse_and_run(argc, argv);
  } catch (const usct::InputError& error) {
    std::fprintf(stderr, "usct: error: %s\n", error.what());
    return usct::tools::kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "usct: failed: %s\n", error.what());
    return usct::tools::kFailed;
  }
}
