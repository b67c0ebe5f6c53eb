#include <cstdio>
#include <memory>

#include "commands.h"
#include "endoscope_files.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/phantom/phantom_files.h"

namespace usct::tools {
namespace {

using phantom::PhantomOptions;

/// Options as given on the command line; CLI11 fills `knobs` directly where the types agree.
struct PhantomCommand {
  PhantomOptions knobs;
  std::string scene = "agar";
  std::string output;
  std::string ct_format = "nrrd";
  std::string ct;
  DicomReadOptions dicom;
  std::string labels;
  std::vector<std::string> tissues;
  std::vector<double> kidney_centre_mm;
  std::string approach = "auto";
  std::vector<int> us_size;
  std::vector<int> ct_size;
  std::vector<double> ct_spacing_mm;
  std::vector<double> ct_oblique_deg;
  bool with_endoscope = false;
  phantom::EndoscopeOptions endoscope;
  std::vector<int> endoscope_size;
  bool no_tumour = false;
  bool no_cyst = false;
  bool no_stone = false;
  bool no_tgc = false;
  bool quiet = false;
};

/// Parses "1=cortex".
std::pair<int, phantom::Tissue> parse_label(const std::string& text) {
  const std::size_t equals = text.find('=');
  int label = 0;
  std::size_t used = 0;
  try {
    label = std::stoi(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (equals == std::string::npos || used != equals || label < 1 || label > 65535)
    throw InputError("--label", "is '" + text + "', must be LABEL=TISSUE, such as 1=cortex");
  return {label, phantom::parse_tissue(text.substr(equals + 1), "--label")};
}

template <typename Vector, typename T>
void copy_three(const std::vector<T>& from, Vector& to) {
  if (!from.empty()) to = Vector(from[0], from[1], from[2]);
}

/// Knobs of the other scenes and sweeps, which change nothing, are refused. What the core refuses
/// by its value is left to it.
void require_used(const CLI::App& app, const PhantomOptions& knobs) {
  using phantom::SceneKind;
  using phantom::SweepKind;
  if (knobs.scene != SceneKind::kAgar)
    require_left_out(app, {"--ball-diameter"}, "--scene is agar");
  if (knobs.scene != SceneKind::kPatient)
    require_left_out(app, {"--no-tumour", "--no-cyst", "--no-stone"}, "--scene is patient");
  if (knobs.scene == SceneKind::kFromCt)
    require_left_out(app, {"--ct-size", "--ct-spacing", "--ct-axes", "--ct-oblique", "--ct-noise"},
                     "--scene is agar or patient");
  if (knobs.sweep.kind == SweepKind::kMotorised)
    require_left_out(app, {"--sweep-length", "--frame-rate"}, "--sweep is tracked");
  if (knobs.sweep.kind == SweepKind::kTrackedLinear)
    require_left_out(app, {"--lateral-fov"}, "--sweep is motorised or tracked-curvilinear");
}

void complete(PhantomCommand& command) {
  PhantomOptions& knobs = command.knobs;
  knobs.scene = phantom::parse_scene(command.scene, "--scene");
  knobs.from_ct.approach = phantom::parse_approach(command.approach, "--approach");
  if (!command.us_size.empty()) {
    knobs.sweep.samples = command.us_size[0];
    knobs.sweep.lines = command.us_size[1];
    knobs.sweep.frames = command.us_size[2];
  }
  if (!command.endoscope_size.empty()) {
    command.endoscope.width = command.endoscope_size[0];
    command.endoscope.height = command.endoscope_size[1];
  }
  copy_three(command.ct_size, knobs.ct.size);
  copy_three(command.ct_spacing_mm, knobs.ct.spacing_mm);
  copy_three(command.ct_oblique_deg, knobs.ct.oblique_deg);
  for (const std::string& text : command.tissues)
    if (const auto [label, tissue] = parse_label(text);
        !knobs.from_ct.tissue_of_label.emplace(label, tissue).second)
      throw InputError("--label", "names " + std::to_string(label) + " twice, must do so once");
  if (!command.kidney_centre_mm.empty())
    knobs.from_ct.kidney_centre_mm = Eigen::Vector3d(command.kidney_centre_mm.data());
  knobs.anatomy.tumour = !command.no_tumour;
  knobs.anatomy.cyst = !command.no_cyst;
  knobs.anatomy.stone = !command.no_stone;
  knobs.ultrasound.time_gain_compensation = !command.no_tgc;
  const bool from_ct = knobs.scene == phantom::SceneKind::kFromCt;
  if (from_ct == command.ct.empty())
    throw InputError("--ct", from_ct ? "is missing, must name the CT of the scene from-ct"
                                     : "is given, must be left out unless --scene is from-ct");
}

phantom::PhantomCase make(const PhantomCommand& command, const Progress& progress) {
  if (command.ct.empty()) return phantom::make_phantom(command.knobs, progress);
  const CtVolume ct = read_ct_with_warnings(command.ct, command.dicom);
  const LabelVolume labels =
      command.labels.empty() ? LabelVolume{} : read_volume<std::uint16_t>(command.labels);
  return phantom::make_phantom_from_ct(ct, labels, command.knobs, progress);
}

int run_phantom(const CLI::App& app, PhantomCommand command) {
  complete(command);
  const std::string extension = "." + command.ct_format;
  command.knobs.validate();
  require_used(app, command.knobs);
  phantom::require_phantom_folder(command.output, extension);
  std::optional<phantom::Endoscope> endoscope;
  if (command.with_endoscope) endoscope.emplace(command.knobs, command.endoscope);
  const phantom::PhantomCase made = make(command, progress_bar("phantom", command.quiet));
  phantom::write_phantom(made, command.output, extension, [&](const std::filesystem::path& folder) {
    if (endoscope)
      write_endoscope(*endoscope, folder / "endoscope", progress_bar("endoscope", command.quiet));
  });
  std::printf("%s\n", command.output.c_str());
  return kDone;
}

void add_anatomy_knobs(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("Anatomy");
  phantom::AnatomyOptions& o = command.knobs.anatomy;
  group->add_option("--contrast", o.contrast, "factor on differences between soft tissues")
      ->capture_default_str();
  group
      ->add_option(
          "--tissue-variation", o.tissue_variation,
          "factor on random changes of each soft tissue's echogenicity (5 dB) and HU (20), "
          "by seed")
      ->capture_default_str();
  group->add_option("--bubbles", o.bubbles, "gas bubbles of 0.2-0.8 mm radius at the kidney")
      ->capture_default_str();
  group
      ->add_option("--ball-diameter", o.ball_diameter_mm,
                   "of the four steel balls of the scene agar, mm")
      ->capture_default_str();
  group->add_option("--standoff", o.standoff_mm, "gel between array and skin, mm [by scene]");
  group->add_option("--indentation", o.indentation_mm,
                    "how deep the probe presses the skin in, mm [agar 0, else 4]");
  group
      ->add_option("--deformation", o.deformation_mm,
                   "largest displacement of the kidney's surface between CT and ultrasound, mm")
      ->capture_default_str();
  group->add_flag("--no-tumour", command.no_tumour, "patient without tumour");
  group->add_flag("--no-cyst", command.no_cyst, "patient without cyst");
  group->add_flag("--no-stone", command.no_stone, "patient without kidney stone");
}

void add_from_ct_options(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("Scene from-ct");
  phantom::FromCtOptions& o = command.knobs.from_ct;
  CLI::Option* ct = group->add_option("--ct", command.ct,
                                      "the CT that becomes the anatomy: file or DICOM folder");
  all_need(ct, *add_dicom_options(app, command.dicom));
  group->add_option("--labels", command.labels, "label map: volume, any grid");
  group->add_option("--label", command.tissues,
                    "tissue of a label, LABEL=TISSUE; cortex stands for a whole kidney");
  group->add_option("--kidney-label", o.kidney_label, "label of the kidney to look at");
  group
      ->add_option("--kidney-centre", command.kidney_centre_mm,
                   "without labels: a point in the kidney, CT mm (LPS)")
      ->expected(3);
  group
      ->add_option("--approach", command.approach,
                   "where the probe is held: auto, lateral, posterior, anterior")
      ->capture_default_str();
  group->add_option("--bone-hu", o.bone_hu, "HU from which unlabelled voxels are bone")
      ->capture_default_str();
  group->add_option("--added-noise", o.added_noise_hu, "noise added to the CT, HU")
      ->capture_default_str();
  all_need(ct, *group);
}

void add_ct_knobs(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("CT");
  phantom::CtOptions& o = command.knobs.ct;
  group
      ->add_option("--ct-size", command.ct_size,
                   "voxels to the left, posterior, superior [320 220 110]")
      ->expected(3);
  group->add_option("--ct-spacing", command.ct_spacing_mm, "mm, in that order [0.468 0.468 1]")
      ->expected(3);
  group->add_option("--ct-axes", o.axes, "storage order: L or R, P or A, S or I")
      ->capture_default_str();
  group->add_option("--ct-oblique", command.ct_oblique_deg, "turns the grid about x, y, z, degrees")
      ->expected(3);
  group->add_option("--ct-noise", o.noise_hu, "standard deviation, HU")->capture_default_str();
}

void add_sweep_knobs(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("Sweep");
  phantom::SweepOptions& o = command.knobs.sweep;
  group->add_option("--size", command.us_size, "samples, lines, frames [154 128 81]")->expected(3);
  group->add_option("--depth", o.depth_mm, "of the last sample, mm [by scene]");
  group->add_option("--lateral-fov", o.lateral_fov_deg,
                    "between the outermost lines, degrees [77.3 motorised, 60 tracked]");
  group->add_option("--elevation-fov", o.elevation_fov_deg, "motor travel, degrees [58.5]");
  group->add_option("--frame-travel", o.frame_travel_deg, "motor travel within a frame, degrees")
      ->capture_default_str();
  group->add_option("--sweep-length", o.sweep_length_mm, "of a tracked sweep, mm")
      ->capture_default_str();
  group->add_option("--frame-rate", o.frame_rate_hz, "of a tracked sweep, 1/s")
      ->capture_default_str();
  group
      ->add_option("--sweep-error", o.sweep_error,
                   "true motor angles against recorded ones: 0 none, 1 as measured in the thesis "
                   "(steps of 0.611 and 0.747 instead of 0.731 degrees)")
      ->capture_default_str();
  group->add_option("--pose-noise-mm", o.pose_noise_mm, "of tracked poses, per axis, mm")
      ->capture_default_str();
  group->add_option("--pose-noise-deg", o.pose_noise_deg, "of tracked poses, per axis, degrees")
      ->capture_default_str();
  group->add_option("--lag", o.lag_s, "of images behind poses, s")->capture_default_str();
  group->add_option("--duplicates", o.duplicate_fraction, "share of frames that repeat the last")
      ->capture_default_str();
  group
      ->add_option("--breathing-mm", o.breathing_mm,
                   "peak-to-peak motion along the patient's superior axis during the sweep, mm")
      ->capture_default_str();
  group->add_option("--breathing-period-s", o.breathing_period_s, "duration of a breath, s")
      ->capture_default_str();
  group->add_option("--sweep-duration-s", o.sweep_duration_s, "of a motorised sweep, s [1.5]");
}

void add_ultrasound_knobs(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("Ultrasound");
  phantom::UltrasoundOptions& o = command.knobs.ultrasound;
  const auto knob = [&](const std::string& name, auto& value, const std::string& help) {
    group->add_option(name, value, help)->capture_default_str();
  };
  group->add_option("--frequency", o.frequency_mhz, "MHz [agar 5, else 3.5]");
  knob("--dynamic-range", o.dynamic_range_db, "shown by the 8 bits, dB");
  knob("--penetration", o.penetration_mm, "depth at which noise drowns soft tissue, mm");
  knob("--clutter", o.clutter_db, "haze relative to the tissue around, dB");
  knob("--tgc-error", o.tgc_error_db, "standard deviation of the TGC sliders, dB");
  group->add_flag("--no-tgc", command.no_tgc, "no time gain compensation");
  knob("--lateral-gain-error", o.lateral_gain_error_db, "standard deviation across lines, dB");
  knob("--frame-gain-error", o.frame_gain_error_db, "standard deviation over frames, dB");
  knob("--specular", o.specular, "factor on specular echoes");
  knob("--reverberation", o.reverberation, "factor on reverberation");
  knob("--no-contact", o.no_contact_lines, "lines at an edge of the fan without contact");
  knob("--sound-speed-error", o.sound_speed_error,
       "echoes are shown at (1 + error) times their depth");
  knob("--tissue-speeds", o.tissue_speeds,
       "0: one speed of sound; 1: each tissue its own, so fat shifts what lies below");
  knob("--echo-texture", o.echo_texture_db,
       "standard deviation of echogenicity within tissues that the CT does not show, dB");
  knob("--edge-shadows", o.edge_shadows,
       "shadows by refraction below edges that the beam grazes: 0 none, 1 as at cysts");
}

void add_endoscope_knobs(CLI::App& app, PhantomCommand& command) {
  CLI::App* group = app.add_option_group("Endoscope");
  phantom::EndoscopeOptions& o = command.endoscope;
  CLI::Option* endoscope = group->add_flag(
      "--endoscope", command.with_endoscope,
      "also renders the video of a stereo endoscope that looks at the tumour, into the "
      "folder endoscope; scene patient");
  const auto knob = [&](const std::string& name, auto& value, const std::string& help) {
    group->add_option("--endoscope-" + name, value, help)->capture_default_str();
  };
  group->add_option("--endoscope-size", command.endoscope_size, "width and height, px [960 540]")
      ->expected(2);
  knob("fov", o.field_of_view_deg, "horizontal field of view without distortion, degrees");
  group->add_option("--endoscope-distortion", o.distortion, "k1, k2, p1, p2, k3 of plumb_bob")
      ->capture_default_str();
  knob("baseline", o.baseline_mm, "between the cameras, mm");
  knob("frames", o.frames, "of each camera");
  knob("rate", o.rate_hz, "frames per s");
  knob("motion", o.camera_motion_mm, "by which the camera moves to either side, mm");
  knob("breathing-mm", o.breathing_mm, "peak-to-peak motion of the anatomy during the video, mm");
  knob("breathing-period-s", o.breathing_period_s, "duration of a breath, s");
  knob("instruments", o.instruments, "0, 1 or 2 that hide parts of the view");
  knob("noise", o.noise, "standard deviation, grey levels");
  all_need(endoscope, *group);
}

}  // namespace

void add_phantom_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "phantom",
      "Makes a digital phantom: CT and pre-scan ultrasound of one kidney in known relative pose.\n"
      "Writes a folder: ct, labels, us.nrrd, truth.tfm (ITK: maps US points to CT points),\n"
      "targets.csv (kidney surface, US mm), fiducials, phantom.json (all options, true geometry).\n"
      "CT in LPS mm; ultrasound in the US frame, mm (x lateral, y axial, z elevation). The same\n"
      "options and seed give the same bits.");
  auto command = std::make_shared<PhantomCommand>();
  sub->add_option("--scene", command->scene, "agar, patient or from-ct")->capture_default_str();
  sub->add_option("--seed", command->knobs.seed, "of everything random")->capture_default_str();
  sub->add_option("--output", command->output, "folder to write; must be absent or empty")
      ->required();
  sub->add_option("--ct-format", command->ct_format, "nrrd, mha or nii.gz")->capture_default_str();
  sub->add_option_function<std::string>(
      "--sweep",
      [command](const std::string& text) {
        command->knobs.sweep.kind = phantom::parse_sweep(text, "--sweep");
      },
      "motorised, tracked-curvilinear or tracked-linear [motorised]");
  // The flag is declared before the knobs. CLI11 applies options in this order, so that knobs given
  // beside the flag override it.
  sub->add_flag_callback(
      "--hard", [command] { command->knobs = phantom::made_hard(command->knobs); },
      "low contrast, weak ultrasound, bubbles, sweep and sound-speed errors, smaller field of "
      "view; other knobs still count");
  add_anatomy_knobs(*sub, *command);
  add_ct_knobs(*sub, *command);
  add_sweep_knobs(*sub, *command);
  add_ultrasound_knobs(*sub, *command);
  add_from_ct_options(*sub, *command);
  add_endoscope_knobs(*sub, *command);
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->callback(
      [sub, command, &run] { run = [sub, command] { return run_phantom(*sub, *command); }; });
}

}  // namespace usct::tools
