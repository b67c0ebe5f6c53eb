#include <cstdio>
#include <filesystem>
#include <memory>

#include "beam_options.h"
#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "progress_bar.h"
#include "simulation_files.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/whole_folder.h"
#include "us_ct_registration/simulation/simulation.h"
#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct::tools {
namespace {

struct SimulateCommand {
  std::string ct;
  DicomReadOptions dicom;
  std::string us;
  BeamCommandOptions ultrasound;
  std::string transform;
  std::string output;

  SimulationOptions simulation;
  std::vector<double> window_hu;
  std::vector<double> weights;
  FitOptions fit;

  ConditioningOptions conditioning;
  Normalisation fit_to = Normalisation::kNone;
  std::vector<double> depth_mm;
  bool no_auto_depth = false;
  bool use_all = false;

  int frame = -1;
  double pixel_mm = 0.4;
  bool quiet = false;
};

void complete(SimulateCommand& command) {
  if (!command.window_hu.empty()) {
    require_rising("--window", command.window_hu);
    command.simulation.window = HuWindow{command.window_hu[0], command.window_hu[1]};
    command.simulation.window->validate("--window");
  }
  if (!command.weights.empty())
    command.fit.fixed_weights =
        SimulationWeights{command.weights[0], command.weights[1], command.weights[2]};
  if (!command.depth_mm.empty()) {
    command.conditioning.depth.min_mm = command.depth_mm[0];
    command.conditioning.depth.max_mm = command.depth_mm[1];
  }
  const SimulationOptions& simulation = command.simulation;
  if (simulation.log_compression == LogCompression::kIntensity) {
    const std::string only = "is given, must be left out unless --log-compression is reflection: ";
    if (simulation.signed_reflection)
      throw InputError("--signed", only + "the intensity has no sign");
    if (simulation.reflection_scale != SimulationOptions().reflection_scale)
      throw InputError("--reflection-scale", only + "the intensity is not scaled");
  }
  command.conditioning.depth.automatic = !command.no_auto_depth;
  if (command.fit_to != Normalisation::kNone) command.conditioning.normalisation = command.fit_to;
  command.simulation.validate("--ct options");
  command.fit.validate("--weights");
  command.conditioning.validate("--us options");
}

/// The reasons why samples are excluded: those of the conditioning, or with --use-all only that a
/// sample is unknown.
std::vector<std::uint8_t> excluded(const SimulateCommand& command,
                                   const ConditionedUltrasound& conditioned) {
  std::vector<std::uint8_t> result = conditioned.reasons;
  if (command.use_all)
    for (std::uint8_t& reasons : result) reasons &= kUnknown;
  return result;
}

void print(const SimulatedUltrasound& simulated, const ConditionedUltrasound& conditioned,
           const std::string& folder) {
  std::printf("%s\n", folder.c_str());
  std::printf("status: %s\n", to_string(simulated.status).c_str());
  if (!simulated.has_fit()) {
    std::printf("why: %s\n", simulated.message.c_str());
    return;
  }
  std::printf("weights: mapped CT %.4g, reflection %.4g, bias %.4g\n", simulated.weights.mapped_ct,
              simulated.weights.reflection, simulated.weights.bias);
  std::printf("LC2: %.4f over %zu of %zu samples (%zu occluded), overlap %.3f\n", simulated.lc2,
              simulated.used, conditioned.reasons.size(), simulated.occluded, simulated.overlap);
  std::printf("depth_mm: %.1f %.1f, far wall on %.0f %% of the beams\n", conditioned.min_depth_mm,
              conditioned.max_depth_mm, 100.0 * conditioned.far_wall_share);
}

int run_simulate(SimulateCommand command) {
  complete(command);
  if (!command.ultrasound.are_parallel())
    command.ultrasound.require_no_compounding("--parallel-beams is given");
  const UltrasoundBeams beams =
      command.ultrasound.beams(command.ultrasound.read(command.us), command.quiet);
  const int frames = beams.along.beams.frames;
  if (command.frame >= frames)
    throw InputError("--frame", "is " + std::to_string(command.frame) + ", must be < " +
                                    std::to_string(frames) + " (frames)");
  if (command.frame < 0) command.frame = frames / 2;
  const CtVolume ct = read_ct_with_warnings(command.ct, command.dicom);
  const Eigen::Isometry3d T_us_ct =
      command.transform.empty() ? Eigen::Isometry3d::Identity() : read_T_us_ct(command.transform);
  require_new_folder(command.output);
  const ConditionedUltrasound conditioned = condition(beams.along, command.conditioning);
  const SimulatedComponents components =
      simulate_components(beams.along.beams, ct, T_us_ct.inverse(), command.simulation,
                          progress_bar("simulation", command.quiet));
  const SimulatedUltrasound simulated = fit_to_ultrasound(
      components,
      command.fit_to == Normalisation::kNone ? beams.along.brightness : conditioned.samples,
      excluded(command, conditioned), command.fit);

  write_whole_folder(command.output, [&](const std::filesystem::path& folder) {
    write_simulation(
        {beams, conditioned, components, simulated, command.simulation, command.fit_to},
        command.frame, command.pixel_mm, folder);
  });
  print(simulated, conditioned, command.output);
  return simulated.has_fit() ? kDone : kRefused;
}

void add_simulation_options(CLI::App& app, SimulateCommand& command) {
  CLI::App* group = app.add_option_group("Simulation (equations of the thesis)");
  SimulationOptions& o = command.simulation;
  group->add_flag_callback(
      "--nearest", [&o] { o.interpolation = Interpolation::kNearest; },
      "nearest CT voxel instead of trilinear");
  group->add_option("--outside-hu", o.outside_hu, "what the CT does not show, HU")
      ->capture_default_str();
  group->add_option("--window", command.window_hu, "limits of the CT values simulated from, HU")
      ->expected(2);
  group
      ->add_option("--gradient-length", o.gradient_length_mm,
                   "eqs 4.3, 4.4: the gradient is a change of CT value over this length, mm")
      ->capture_default_str();
  group->add_option("--transmission-length", o.transmission_length_mm,
                    "eq 4.6: one factor t per this path, mm [per sample]");
  CLI::Option* occlusion = group->add_flag("--occlusion", o.occlusion.by_threshold,
                                           "bone and gas reflect everything (patients)");
  group->add_option("--bone-hu", o.occlusion.bone_hu, "bone from here, HU")
      ->needs(occlusion)
      ->capture_default_str();
  group->add_option("--gas-hu", o.occlusion.gas_hu, "gas below, HU")
      ->needs(occlusion)
      ->capture_default_str();
  group
      ->add_option("--echo", o.occlusion.echo_mm,
                   "bone and gas echo for this length along the beam, mm [they are occluded]")
      ->needs(occlusion);
  group
      ->add_option("--log-compression", o.log_compression,
                   "eq 4.7 of the reflection, or of the intensity as printed")
      ->transform(named<LogCompression>({{"reflection", LogCompression::kReflection},
                                         {"intensity", LogCompression::kIntensity}}));
  group->add_option("--log-a", o.log_a, "a of eq 4.7")->capture_default_str();
  group->add_option("--reflection-scale", o.reflection_scale, "factor on r before eq 4.7")
      ->capture_default_str();
  group->add_flag("--signed", o.signed_reflection, "keep the sign of the reflection");
  group->add_option("--slope", o.map.slope, "eq 4.8")->capture_default_str();
  group->add_option("--offset", o.map.offset, "eq 4.8")->capture_default_str();
  group->add_flag_callback(
      "--no-clamp", [&o] { o.map.clamp = false; }, "do not limit p to [0, 255]");
  group
      ->add_option("--weights", command.weights,
                   "of mapped CT and reflection, and bias (eq 4.9: alpha, beta, gamma); least "
                   "squares if not given")
      ->expected(3);
}

void add_conditioning_options(CLI::App& app, SimulateCommand& command) {
  CLI::App* group = app.add_option_group("Conditioning of the ultrasound");
  ConditioningOptions& o = command.conditioning;
  group->add_option("--fit-to", command.fit_to, "what the simulation is fitted to")
      ->transform(named<Normalisation>({{"brightness", Normalisation::kNone},
                                        {"flattened", Normalisation::kFlatten},
                                        {"z-score", Normalisation::kZScore}}));
  CLI::Option* depth =
      group->add_option("--depth", command.depth_mm, "depths that count, mm [found]")->expected(2);
  CLI::Option* all_depths = group->add_flag("--no-auto-depth", command.no_auto_depth,
                                            "all depths count unless --depth says");
  group
      ->add_flag("--use-all", command.use_all,
                 "near field, shadows and all else that is left out counts as well (the thesis)")
      ->excludes(depth)
      ->excludes(all_depths);
  group->add_option("--smoothing", o.smoothing_mm, "Gaussian against speckle, mm")
      ->capture_default_str();
  group->add_option("--normalisation-window", o.window_mm, "Gaussian of the local mean, mm")
      ->capture_default_str();
}

}  // namespace

void add_simulate_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "simulate",
      "Simulates ultrasound from CT along the beams of an acquisition, fits it to the ultrasound, "
      "and writes, as NRRD in the ultrasound's geometry: ultrasound, ct, gradient, reflection, "
      "intensity, mapped_ct, simulated, conditioned (simulation.json says which values are 0 and "
      "255), flags and excluded. One frame is drawn along the beams (frame_beams.png) and, without "
      "--parallel-beams, scan-converted (frame.png). CT in LPS mm, ultrasound in the US frame, mm. "
      "Exit status 3 if nothing could be fitted.");
  auto command = std::make_shared<SimulateCommand>();
  sub->add_option("--ct", command->ct, "DICOM folder or file, NRRD, MetaImage or NIfTI")
      ->required();
  sub->add_option("--us", command->us, "ultrasound of any kind that 'usct info' knows")->required();
  sub->add_option("--transform", command->transform,
                  "ITK transform from US to CT points, mm, LPS (identity if not given)");
  sub->add_option("--output", command->output, "folder to make: absent or empty")->required();
  sub->add_option("--frame", command->frame, "frame to draw [the middle one]")->check(at_least(0));
  sub->add_option("--pixel", command->pixel_mm, "size of a pixel of the pictures, mm")
      ->check(within(0.05, 10.0))
      ->capture_default_str();
  add_simulation_options(*sub, *command);
  add_conditioning_options(*sub, *command);
  add_dicom_options(*sub, command->dicom);
  command->ultrasound.add_to(*sub);
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->callback([command, &run] { run = [command] { return run_simulate(*command); }; });
}

}  // namespace usct::tools
