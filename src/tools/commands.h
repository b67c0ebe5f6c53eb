#pragma once

#include <CLI/CLI.hpp>
#include <functional>

/// The subcommands of `usct`, one file each. Every function adds its subcommand and options to
/// `app`; when the subcommand is chosen, it sets `run` to the work to do, whose result is the exit
/// status (see exit_status.h).
namespace usct::tools {

using Run = std::function<int()>;

/// Marks an option as the name of a file that the command writes, as all that are called `output`
/// are: `run_program` refuses one that is an input too.
inline CLI::Option* writes(CLI::Option* option) { return option->type_name("OUTPUT"); }
inline bool is_written(const CLI::Option& option) {
  return option.get_type_name() == "OUTPUT" || option.check_name("output") ||
         option.check_name("--output");
}

void add_info_command(CLI::App& app, Run& run);
void add_convert_command(CLI::App& app, Run& run);
void add_slices_command(CLI::App& app, Run& run);
void add_overlay_command(CLI::App& app, Run& run);
void add_surfaces_command(CLI::App& app, Run& run);
void add_calibrate_motor_command(CLI::App& app, Run& run);
void add_lag_command(CLI::App& app, Run& run);
void add_phantom_command(CLI::App& app, Run& run);
void add_simulate_command(CLI::App& app, Run& run);
void add_register_command(CLI::App& app, Run& run);
void add_presets_command(CLI::App& app, Run& run);
void add_evaluate_command(CLI::App& app, Run& run);
void add_gold_command(CLI::App& app, Run& run);
void add_case_command(CLI::App& app, Run& run);
void add_study_command(CLI::App& app, Run& run);
/// Runs the program usct_bag (ros/) in place of this one, so that other subcommands do not load the
/// libraries of ROS, which takes 20 ms. In a build without ROS the subcommand only says so.
void add_bag_command(CLI::App& app, Run& run);

}  // namespace usct::tools
