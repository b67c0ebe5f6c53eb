#include <cstdio>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct::tools {
namespace {

struct PresetsCommand {
  std::string name;
  bool complete = false;
};

/// The first sentence of the comment with which each file begins; the sentence contains no full
/// stop except its last.
std::string title(const std::string& yaml) {
  std::string comment;
  for (std::size_t begin = 0; yaml.compare(begin, 2, "# ") == 0;) {
    const std::size_t end = yaml.find('\n', begin);
    comment += (comment.empty() ? "" : " ") + yaml.substr(begin + 2, end - begin - 2);
    if (end == std::string::npos) break;
    begin = end + 1;
  }
  return comment.substr(0, comment.find_first_of('.'));
}

int run_presets(const PresetsCommand& command) {
  if (command.name.empty())
    for (const std::string& name : preset_names())
      std::printf("%-10s %s\n", name.c_str(), title(preset_yaml(name)).c_str());
  else if (command.complete)
    std::fputs(registration_options_yaml(preset(command.name)).c_str(), stdout);
  else
    std::fputs(preset_yaml(command.name).c_str(), stdout);
  return kDone;
}

}  // namespace

void add_presets_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "presets",
      "Lists the options that 'usct register --preset' knows, or prints one of them: YAML, lengths "
      "in mm, angles in degrees. A file for 'usct register --options' that begins with 'preset: "
      "NAME' needs only what differs.");
  auto command = std::make_shared<PresetsCommand>();
  CLI::Option* name = sub->add_option("name", command->name, "preset to print");
  sub->add_flag("--complete", command->complete,
                "every value, with those that it takes from another preset; without comments")
      ->needs(name);
  sub->callback([command, &run] { run = [command] { return run_presets(*command); }; });
}

}  // namespace usct::tools
