#include <cstdio>
#include <exception>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/error.h"

int main(int argc, char** argv) {
  using namespace usct;  // NOLINT(google-build-using-namespace)
  CLI::App app{"usct: registration of preoperative CT to 3D ultrasound of the kidney"};
  app.set_version_flag("--version", USCT_VERSION);
  app.require_subcommand(1);
  app.footer("Exit status: 0 done, 1 failed, 2 bad arguments or input, 3 registration refused.");
  tools::Run run;
  tools::add_info_command(app, run);
  tools::add_convert_command(app, run);
  tools::add_slices_command(app, run);
  tools::add_calibrate_motor_command(app, run);
  tools::add_phantom_command(app, run);
  tools::add_simulate_command(app, run);
  tools::add_evaluate_command(app, run);
  try {
    app.parse(argc, argv);
    return run();
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return tools::kBadInput;
  } catch (const InputError& error) {
    std::fprintf(stderr, "usct: error: %s\n", error.what());
    return tools::kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "usct: failed: %s\n", error.what());
    return tools::kFailed;
  }
}
