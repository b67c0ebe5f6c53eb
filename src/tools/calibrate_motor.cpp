#include <cstdio>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/wire_distances.h"

namespace usct::tools {
namespace {

struct CalibrateOptions {
  std::string wire_distances;
  double true_distance_mm = 0.0;
  std::optional<int> frames;
  bool falling = false;
  bool fit_distance = false;
  std::string probe;
  std::string output;
};

void print(const MotorCalibration& calibration, double true_distance_mm) {
  const auto print_half = [](const char* name, const SweepHalf& half) {
    std::printf("%s: %.4f +- %.4f degrees per frame (%d frames)\n", name, half.step_rad / kDegree,
                half.standard_error_rad / kDegree, half.frames);
  };
  std::printf("zero angle: frame %.2f +- %.2f\n", calibration.zero_frame,
              calibration.zero_frame_standard_error);
  print_half("before it", calibration.before);
  print_half("after it", calibration.after);
  if (calibration.distance_standard_error_mm > 0.0)
    std::printf("distance of the wires: %.3f +- %.3f mm, %.4f of the true one\n",
                calibration.distance_mm, calibration.distance_standard_error_mm,
                calibration.distance_mm / true_distance_mm);
  std::printf("scatter about the fit: %.3f mm RMS\n", calibration.rms_residual_mm);
  int at_minimum = 0;
  int missing = 0;
  for (const SliceAngle& slice : calibration.slices) {
    at_minimum += slice.status == SliceAngle::Status::kAtMinimum ? 1 : 0;
    missing += slice.status == SliceAngle::Status::kMissing ? 1 : 0;
  }
  std::printf("frames: %zu, %d of them with distances not above the true one, %d without wires\n",
              calibration.slices.size(), at_minimum, missing);
}

int run_calibrate(const CalibrateOptions& options) {
  ProbeConfig probe = read_probe_config(options.probe);
  if (!probe.motor) throw InputError(options.probe, "'kind' has no motor, must be motorised");
  const WireDistances distances =
      read_wire_distances(options.wire_distances, options.true_distance_mm, options.frames);
  MotorCalibrationOptions calibration_options;
  calibration_options.rising = !options.falling;
  calibration_options.fit_distance = options.fit_distance;
  const MotorCalibration calibration =
      calibrate_motor(distances, calibration_options, options.wire_distances);
  probe.motor->step_rad.reset();
  probe.motor->steps_per_frame.reset();
  probe.motor->frame_angles_rad = calibration.frame_angles_rad;
  write_probe_config(probe, options.output);
  print(calibration, options.true_distance_mm);
  return kDone;
}

}  // namespace

void add_calibrate_motor_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "calibrate-motor",
      "Measures the motor angle of each frame of a motorised probe with an N-wire phantom: "
      "parallel "
      "wires, a distance d apart in depth and along the elevation axis, appear h = d / cos(angle) "
      "apart in a frame. Fits an even step to either half of the sweep and writes the angles into "
      "a "
      "probe YAML. Millimetres and degrees.");
  auto options = std::make_shared<CalibrateOptions>();
  command
      ->add_option("--wire-distances", options->wire_distances,
                   "CSV with the header volume,frame,distance_mm: h of each pair of wires in each "
                   "frame of several forward sweeps, numbers from 0")
      ->required();
  command
      ->add_option("--true-distance-mm", options->true_distance_mm,
                   "d, from a CT or a drawing of the phantom")
      ->required();
  command
      ->add_option("--frames", options->frames,
                   "frames of a sweep, if the last of them show no wires")
      ->check(at_least(2));
  command->add_flag("--falling", options->falling,
                    "frame angles fall with the frame number (default: they rise)");
  command->add_flag("--fit-distance", options->fit_distance,
                    "estimate d too: if the speed of sound in the phantom is not the scanner's");
  command->add_option("--probe", options->probe, "probe YAML to start from")->required();
  command->add_option("--output", options->output, "calibrated probe YAML")->required();
  command->callback([options, &run] { run = [options] { return run_calibrate(*options); }; });
}

}  // namespace usct::tools
