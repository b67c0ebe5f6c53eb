#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <future>
#include <map>
#include <optional>

#include "beam_options.h"
#include "commands.h"
#include "exit_status.h"
#include "initial_pose.h"
#include "inputs.h"
#include "landmark_warning.h"
#include "option_checks.h"
#include "program.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/registration/confidence_text.h"
#include "us_ct_registration/registration/rough_pose.h"
#include "us_ct_registration/rendering/registration_pictures.h"
#include "us_ct_registration/threads.h"

namespace usct::tools {
namespace {

constexpr const char* kDefaultPreset = "patient";
/// The preset whose search is wide enough to succeed without an initial pose.
constexpr const char* kGlobalPreset = "global";

struct RegisterCommand {
  std::string ct;
  DicomReadOptions dicom;
  std::string us;
  BeamCommandOptions ultrasound;
  InitialPose initial;
  bool all_orientations = false;

  std::string preset;
  std::string options;
  std::optional<std::uint32_t> seed;
  int threads = thread_count();

  std::string output;
  std::string transform;
  std::string pictures;
  std::string targets;
  bool quiet = false;
  bool json = false;
};

/// The input of a registration: the images, the initial pose and the targets.
struct Case {
  CtVolume ct;
  Ultrasound us;
  BeamUltrasound beams;
  Eigen::Isometry3d T_us_ct_initial;
  std::vector<Eigen::Vector3d> targets_us_mm;
};

void start_from_all_orientations(RegistrationOptions& options) {
  std::optional<StartOptions>& starts = options.search.starts;
  if (!starts)
    throw InputError("--all-orientations", "is given, but the search of the options has no starts");
  starts->region = StartRegion::kBall;
  starts->rotation_rad = kPi;  // up to half a turn
  // Orientations need more starts than the few dozen degrees that presets are made for. With this
  // factor all of the real sweeps on which it was tried are found, with 1 most (docs/accuracy.md).
  constexpr int kTimesAsWide = 2;
  starts->count *= kTimesAsWide;
  for (LevelOptions& level : options.search.levels) level.optimised *= kTimesAsWide;
}

RegistrationOptions options_of(const RegisterCommand& command) {
  RegistrationOptions options =
      command.options.empty() ? preset(command.preset.empty() ? kDefaultPreset : command.preset)
                              : read_registration_options(command.options);
  if (command.seed) options.seed = *command.seed;
  if (command.all_orientations) start_from_all_orientations(options);
  options.validate();
  return options;
}

void require_initial_pose(const RegisterCommand& command) {
  if (command.initial.is_given() || command.preset == kGlobalPreset || command.all_orientations)
    return;
  throw InputError("--initial",
                   "is missing, must be given, or --landmarks, or --probe-direction; none is "
                   "needed with --preset global or --all-orientations");
}

void require_places(const RegisterCommand& command) {
  require_place_ending("--output", command.output, ".json");
  if (!command.pictures.empty()) {
    std::error_code error;
    std::filesystem::create_directory(command.pictures, error);
    if (!std::filesystem::is_directory(command.pictures))
      throw InputError("--pictures",
                       "'" + command.pictures + "' cannot be made: " + error.message());
  }
  if (!command.transform.empty()) require_transform_place("--transform", command.transform);
}

/// Reads the CT beside the ultrasound, if there is a second thread.
std::future<CtVolume> start_reading_ct(const RegisterCommand& command) {
  return std::async(command.threads == 1 ? std::launch::deferred : std::launch::async, [&command] {
    const ThreadCount threads(command.threads);  // each thread has its own
    return read_ct_with_warnings(command.ct, command.dicom,
                                 progress_bar("reading the CT", command.quiet));
  });
}

Case read_case(const RegisterCommand& command) {
  Case c;
  if (!command.targets.empty()) c.targets_us_mm = read_points_mm(command.targets);
  std::future<CtVolume> ct = start_reading_ct(command);
  c.us = command.ultrasound.read(command.us);
  c.ct = ct.get();
  c.beams = command.ultrasound.beams(c.us, command.quiet).along;
  if (!c.targets_us_mm.empty()) warn_of_targets({command.targets, c.targets_us_mm}, c.beams.beams);
  c.T_us_ct_initial = command.initial.T_us_ct(c.ct, c.beams.beams);
  return c;
}

void describe_run(const RegisterCommand& command, const RegistrationOptions& options,
                  RegistrationResult& result) {
  for (const auto& [key, value] : registration_options_text(options))
    result.options.emplace(key, value);
  if (command.options.empty())
    result.options.emplace("preset", command.preset.empty() ? kDefaultPreset : command.preset);
  if (result.version.empty()) result.version = USCT_VERSION;
}

bool is_registered(const RegistrationResult& result) { return result.T_us_ct.has_value(); }

void write_pictures(const RegisterCommand& command, const Case& c,
                    const RegistrationResult& result) {
  constexpr double kSpacingMm = 0.8;
  constexpr double kHoleFillMm = 4.0;
  CompoundOptions compounding = command.ultrasound.compounding(c.us);
  if (compounding.hole_fill_radius_mm == 0.0) compounding.hole_fill_radius_mm = kHoleFillMm;
  RegistrationPictureOptions options;
  options.axes_us = picture_axes(c.us);
  write_registration_pictures(
      in_space(c.us, kSpacingMm, compounding, progress_bar("pictures", command.quiet)), c.ct,
      c.T_us_ct_initial, result, command.pictures, options);
}

/// Displacement of the middle of the field by `T`, and the angle of its rotation.
struct Motion {
  double mm;
  double degrees;
};

Motion motion_between(const Eigen::Isometry3d& T_us_ct_from, const Eigen::Isometry3d& T_us_ct_to,
                      const Eigen::Vector3d& point_us_mm) {
  const Eigen::Isometry3d T = T_us_ct_to * T_us_ct_from.inverse();
  return {(T * point_us_mm - point_us_mm).norm(), Eigen::AngleAxisd(T.linear()).angle() / kDegree};
}

void print_expected_errors(const RegistrationResult& result,
                           const std::vector<Eigen::Vector3d>& targets_us_mm) {
  if (!result.covariance) {
    std::printf("expected error: not known (the result has no covariance)\n");
    return;
  }
  const ExpectedTargetErrors errors = expected_tre_mm(*result.covariance, targets_us_mm);
  std::printf("expected error at %zu targets, mm: RMS %.2f, max %.2f\n", targets_us_mm.size(),
              errors.rms_mm, errors.max_mm);
}

void print_candidates(const RegistrationResult& result, const Eigen::Vector3d& middle_us_mm) {
  for (std::size_t i = 1; i < result.candidates.size(); ++i) {
    const RegistrationCandidate& candidate = result.candidates[i];
    const Motion apart =
        motion_between(result.candidates[0].T_us_ct, candidate.T_us_ct, middle_us_mm);
    std::printf("further optimum: similarity %.4f, overlap %.2f, %.1f mm and %.1f degrees away\n",
                candidate.similarity, candidate.overlap, apart.mm, apart.degrees);
  }
}

void print_acquisition_errors(const Measures& measures) {
  constexpr double kPercent = 100.0;
  if (measures.depth_error)
    std::printf("estimated depth error: %+.2f %%\n", kPercent * *measures.depth_error);
  if (measures.sweep_error)
    std::printf("estimated sweep error: %+.2f %%\n", kPercent * *measures.sweep_error);
  if (measures.sweep_unevenness)
    std::printf("estimated sweep unevenness: %+.2f %%\n", kPercent * *measures.sweep_unevenness);
}

void print_seconds(const std::map<std::string, double>& seconds) {
  double sum = 0.0;
  for (const auto& [stage, duration] : seconds) sum += duration;
  std::printf("seconds: %.3f", sum);
  for (const auto& [stage, duration] : seconds)
    std::printf("%s%s %.3f", &stage == &seconds.begin()->first ? " = " : " + ", stage.c_str(),
                duration);
  std::printf("\n");
}

void print_summary(const RegisterCommand& command, const Case& c,
                   const RegistrationResult& result) {
  const Eigen::Vector3d middle_us_mm = c.beams.beams.middle_mm();
  std::printf("status: %s\nreason: %s\n", status_name(result.status), result.message.c_str());
  std::printf("similarity: %.4f, overlap %.2f\n", result.similarity, result.overlap);
  if (!result.candidates.empty()) {
    const Motion moved =
        motion_between(c.T_us_ct_initial, result.candidates[0].T_us_ct, middle_us_mm);
    std::printf("%s: %.1f mm and %.1f degrees from the initial pose\n",
                is_registered(result) ? "found" : "best pose, refused", moved.mm, moved.degrees);
  }
  std::fputs(confidence_text(result).c_str(), stdout);
  if (!c.targets_us_mm.empty()) print_expected_errors(result, c.targets_us_mm);
  print_candidates(result, middle_us_mm);
  print_acquisition_errors(result.measures);
  std::printf("evaluations: %d\n", result.evaluations);
  print_seconds(result.seconds);
  std::printf("%s\n", command.output.c_str());
  if (is_registered(result) && !command.transform.empty())
    std::printf("%s\n", command.transform.c_str());
}

/// Warns on standard error even with --quiet and --json: an old transform must not be taken for a
/// new one.
void warn_of_refusal(const RegisterCommand& command, const RegistrationResult& result) {
  std::fprintf(stderr, "usct: not registered: %s (%s)\n", status_name(result.status),
               result.message.c_str());
  if (command.transform.empty()) return;
  std::fprintf(stderr, "usct: %s: %s\n", command.transform.c_str(),
               std::filesystem::exists(command.transform)
                   ? "not written; what is there stays as it was"
                   : "not written");
}

int run_register(const RegisterCommand& command) {
  const RegistrationOptions options = options_of(command);
  require_initial_pose(command);
  if (command.pictures.empty() && !command.ultrasound.are_parallel())
    command.ultrasound.require_no_compounding("--pictures or --parallel-beams is given");
  require_places(command);
  const ThreadCount threads(command.threads);
  const Case c = read_case(command);
  RegistrationHooks hooks;
  hooks.progress = progress_bar("registration", command.quiet);
  RegistrationResult result = register_ultrasound(c.beams, c.ct, c.T_us_ct_initial, options, hooks);
  describe_run(command, options, result);

  write_result(result, command.output);
  if (command.json)
    std::fputs(result_json(result).c_str(), stdout);
  else
    print_summary(command, c, result);
  if (!is_registered(result)) warn_of_refusal(command, result);
  if (!command.pictures.empty()) write_pictures(command, c, result);
  if (!is_registered(result)) return kRefused;
  // It comes last, since it says that all else went well.
  require_printed();
  if (!command.transform.empty()) write_T_us_ct(*result.T_us_ct, command.transform);
  return kDone;
}

void add_how(CLI::App& sub, RegisterCommand& command) {
  CLI::App* group = sub.add_option_group("How");
  CLI::Option* preset = group->add_option("--preset", command.preset,
                                          "options by name, see 'usct presets' [patient]");
  group
      ->add_option("--options", command.options,
                   "options as YAML (docs/registration_options.md); may name a preset to change")
      ->excludes(preset);
  group->add_flag("--all-orientations", command.all_orientations,
                  "starts have every orientation, not only those near the initial pose");
  group->add_option("--seed", command.seed, "of everything random [that of the options]");
  group->add_option("--threads", command.threads, "[all]; does not change the result")
      ->check(within(1, 1024));
}

}  // namespace

void add_register_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "register",
      "Registers a CT to ultrasound: finds the rigid transform between them, and says how sure it "
      "is. CT in LPS mm, ultrasound in the US frame, mm (x lateral, y axial, z elevation). Exit "
      "status 0: registered; 2: bad arguments or input; 3: not registered, because what was "
      "found must not be used or no search was possible (the result says why, and no transform is "
      "written).");
  auto command = std::make_shared<RegisterCommand>();
  sub->add_option("--ct", command->ct, "DICOM folder or file, NRRD, MetaImage or NIfTI")
      ->required();
  sub->add_option("--us", command->us, "ultrasound of any kind that 'usct info' knows")->required();
  command->initial.add_to(*sub);
  add_how(*sub, *command);
  sub->add_option("--output", command->output, "result to write, .json")->required();
  writes(sub->add_option("--transform", command->transform,
                         "ITK transform to write if registered, from US to CT points, mm, LPS "
                         "(.tfm, .txt, .h5)"));
  sub->add_option("--pictures", command->pictures,
                  "folder to draw pictures in, made if absent: before and after, fused, slices");
  CLI::Option* targets =
      sub->add_option("--targets", command->targets,
                      "CSV x,y,z of points of the US frame, mm: prints the error that the result "
                      "expects there");
  command->ultrasound.add_to(*sub);
  add_dicom_options(*sub, command->dicom);
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->add_flag("--json", command->json, "print the result as JSON instead of a summary")
      ->excludes(targets);
  sub->callback([command, &run] { run = [command] { return run_register(*command); }; });
}

}  // namespace usct::tools
