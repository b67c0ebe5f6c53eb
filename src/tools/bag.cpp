#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include "commands.h"
#include "us_ct_registration/error.h"

namespace usct::tools {
namespace {

/// Path of usct_bag, which is installed in the folder of this program.
std::filesystem::path bag_program() {
  return std::filesystem::canonical("/proc/self/exe").parent_path() / "usct_bag";
}

/// Replaces this process by usct_bag. Returns only by throwing.
[[noreturn]] void become_bag_program(std::vector<std::string> arguments) {
  const std::filesystem::path program = bag_program();
  if (!std::filesystem::exists(program))
    throw InputError("bag", "there is no '" + program.string() +
                                "': this usct was built without ROS (USCT_CORE_ONLY), or the "
                                "package ros-us-ct-registration is not installed; bags need it");
  std::string name = program.string();
  std::vector<char*> argv = {name.data()};
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  ::execv(name.c_str(), argv.data());
  throw std::runtime_error(name + ": cannot be started: " + std::strerror(errno));
}

}  // namespace

void add_bag_command(CLI::App& app, Run& run) {
  CLI::App* bag =
      app.add_subcommand("bag", "Bags of acquisitions: makes and reads them (in builds with ROS).");
  bag->prefix_command();  // all arguments that follow are for usct_bag, --help too
  bag->set_help_flag();
  bag->callback([bag, &run] { run = [bag]() -> int { become_bag_program(bag->remaining()); }; });
}

}  // namespace usct::tools
