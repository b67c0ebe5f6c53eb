#include <cstdio>
#include <exception>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/error.h"

int main(int argc, char** argv) {
  using namespace usct;  // NOLINT(google-build-using-namespace)
  CLI::App app{"usct: registration of preoperative CT to 3D ultrasound of the kidney"};
  app.require_subcommand(1);
  tools::Run run;
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
