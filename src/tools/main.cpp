#include "commands.h"
#include "program.h"

int main(int argc, char** argv) {
  using namespace usct::tools;
  CLI::App app{"usct: registration of preoperative CT to 3D ultrasound of the kidney"};
  Run run;
  add_info_command(app, run);
  add_convert_command(app, run);
  add_slices_command(app, run);
  add_overlay_command(app, run);
  add_surfaces_command(app, run);
  add_calibrate_motor_command(app, run);
  add_lag_command(app, run);
  add_phantom_command(app, run);
  add_simulate_command(app, run);
  add_register_command(app, run);
  add_presets_command(app, run);
  add_evaluate_command(app, run);
  add_gold_command(app, run);
  add_case_command(app, run);
  add_study_command(app, run);
  add_bag_command(app, run);
  return run_program(app, run, argc, argv);
}
