#include "commands.h"
#include "us_ct_registration/error.h"

namespace usct::tools {

void add_bag_command(CLI::App& app, Run& run) {
  CLI::App* bag = app.add_subcommand("bag", "Bags of acquisitions: only in builds with ROS.");
  bag->allow_extras();
  bag->callback([&run] {
    run = []() -> int {
      throw InputError("bag", "this usct was built without ROS (USCT_CORE_ONLY); bags need it");
    };
  });
}

}  // namespace usct::tools
