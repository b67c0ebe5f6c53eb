#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "exit_status.h"
#include "progress_bar.h"
#include "study_pictures.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/study_report.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct::tools {
namespace {

struct StudyCommand {
  std::vector<std::string> folders;
  std::vector<std::string> strangers;
  StudyOptions study;
  bool negatives = false;
  std::vector<std::string> kinds;
  double max_rotation_deg = 30.0;
  double box_mm = -1.0;
  double box_deg = -1.0;
  std::string preset = "patient";
  std::string options;
  double parallel_beams_mm = 0.0;
  int threads = omp_get_max_threads();
  bool one_after_other = false;
  bool thesis_table = false;
  bool unjudged = false;
  std::string output;
  std::string pictures;
  bool quiet = false;
};

/// The kinds that are named, or all negative ones (with strangers, if there are any).
std::vector<TrialKind> kinds_of(const StudyCommand& command) {
  std::vector<TrialKind> kinds;
  for (const std::string& name : command.kinds) kinds.push_back(parse_kind(name, "--kinds"));
  if (command.negatives)
    for (const TrialKind kind : negative_kinds())
      if (kind != TrialKind::kStranger || !command.strangers.empty()) kinds.push_back(kind);
  return kinds;
}

void complete(StudyCommand& command) {
  if (command.negatives || !command.kinds.empty()) command.study.kinds = kinds_of(command);
  command.study.max_rotation_rad = command.max_rotation_deg * kDegree;
  if (command.box_mm >= 0.0 || command.box_deg >= 0.0)
    command.study.box =
        MotionBox{std::max(0.0, command.box_deg) * kDegree, std::max(0.0, command.box_mm)};
  command.study.validate("usct study");
  // The folder is checked first, since hours of work must not be lost at the end.
  const std::filesystem::path folder =
      std::filesystem::absolute(command.output.empty() ? "." : command.output).parent_path();
  if (!std::filesystem::is_directory(folder))
    throw InputError("--output",
                     "lies in '" + folder.string() + "', must be in a folder that exists");
  if (!command.pictures.empty()) std::filesystem::create_directories(command.pictures);
}

/// Edges of the table's bins. They span the distances over which starts were spread or, for starts
/// from a box, all distances that occurred.
std::vector<double> bin_edges_mm(const StudyOptions& study, const std::vector<Trial>& trials) {
  double low_mm = study.min_displacement_mm;
  double high_mm = study.max_displacement_mm;
  if (study.box) {
    low_mm = high_mm = 0.0;
    for (const Trial& trial : trials)
      if (trial.kind == TrialKind::kStart) high_mm = std::max(high_mm, trial.displacement_mm);
    high_mm = std::max(1.0, std::ceil(high_mm / study.bins)) * study.bins;
  }
  std::vector<double> edges_mm;
  for (int i = 0; i <= study.bins; ++i)
    edges_mm.push_back(low_mm + (high_mm - low_mm) * i / study.bins);
  return edges_mm;
}

RegistrationOptions options_of(const StudyCommand& command) {
  RegistrationOptions options =
      command.options.empty() ? preset(command.preset) : read_registration_options(command.options);
  if (command.unjudged) options.confidence.gates = GateLimits::none();
  options.validate();
  return options;
}

BeamOptions beams_for(const StudyCommand& command) {
  BeamOptions beams;
  if (command.parallel_beams_mm > 0.0) beams.parallel_beams_mm = command.parallel_beams_mm;
  return beams;
}

Register registers_with(const StudyCommand& command) {
  return [options = options_of(command), beams = beams_for(command)](
             const PreScanVolume& ultrasound, const CtVolume& ct,
             const Eigen::Isometry3d& T_us_ct_initial) {
    return register_ultrasound(beams_of(ultrasound, beams).along, ct, T_us_ct_initial, options);
  };
}

std::string as_text(double value) { return formatted("%g", value); }

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Properties that tell one study from another, for its JSON.
std::map<std::string, std::string> description(const StudyCommand& command) {
  std::vector<std::string> kinds;
  for (const TrialKind kind : command.study.kinds) kinds.emplace_back(kind_name(kind));
  std::map<std::string, std::string> study{
      {"options", command.options.empty() ? "preset " + command.preset : command.options},
      {"starts", std::to_string(command.study.starts)},
      {"seed", std::to_string(command.study.seed)},
      {"kinds", joined(kinds)},
      {"strangers", joined(command.strangers)},
      {"parallel_beams_mm", as_text(command.parallel_beams_mm)},
      {"one_after_other", command.one_after_other ? "true" : "false"},
      {"unjudged", command.unjudged ? "true" : "false"}};
  if (command.study.box) {
    study["box_mm"] = as_text(command.study.box->translation_mm);
    study["box_deg"] = as_text(command.study.box->rotation_rad / kDegree);
  } else {
    study["min_displacement_mm"] = as_text(command.study.min_displacement_mm);
    study["max_displacement_mm"] = as_text(command.study.max_displacement_mm);
    study["max_rotation_deg"] = as_text(command.max_rotation_deg);
  }
  return study;
}

void print_tables(const StudyCommand& command, const std::vector<StudyCase>& cases,
                  const std::vector<Trial>& trials, const std::vector<StudyRun>& runs) {
  const std::string negatives = negatives_markdown(runs);
  std::printf("%s", negatives.c_str());
  const std::vector<TrialKind>& kinds = command.study.kinds;
  if (std::find(kinds.begin(), kinds.end(), TrialKind::kStart) == kinds.end()) return;
  if (!negatives.empty()) std::printf("\n");
  std::printf("%s\n", accuracy_markdown(runs, bin_edges_mm(command.study, trials)).c_str());
  if (command.thesis_table)
    std::printf("%s\n", thesis_markdown(cases, runs, beams_for(command)).c_str());
  std::printf("%s", calibration_markdown(runs).c_str());
}

int run_study(StudyCommand command) {
  complete(command);
  const Register register_one = registers_with(command);
  std::vector<StudyCase> cases;
  for (const std::string& folder : command.folders) cases.push_back(read_study_case(folder));
  for (const std::string& folder : command.strangers) cases.push_back(read_stranger(folder));
  const std::vector<Trial> trials = plan_trials(cases, command.study);
  const std::vector<StudyRun> runs =
      run_trials(cases, trials, register_one,
                 command.one_after_other ? StudyThreads::kWithinTrial : StudyThreads::kOverTrials,
                 command.threads, progress_bar("study", command.quiet));
  if (!command.output.empty()) write_study_json(runs, description(command), command.output);
  if (!command.pictures.empty()) write_study_pictures(cases, runs, command.pictures);
  print_tables(command, cases, trials, runs);
  return kDone;
}

void add_start_options(CLI::App& app, StudyCommand& command) {
  CLI::App* group = app.add_option_group("Starts");
  StudyOptions& o = command.study;
  group->add_option("--starts", o.starts, "per case and kind of trial")->capture_default_str();
  CLI::Option* low = group->add_option("--min-displacement", o.min_displacement_mm,
                                       "least mean displacement of the targets, mm");
  CLI::Option* high = group->add_option("--max-displacement", o.max_displacement_mm,
                                        "largest mean displacement of the targets, mm");
  CLI::Option* angle = group->add_option("--max-rotation-deg", command.max_rotation_deg,
                                         "largest rotation, degrees");
  for (CLI::Option* option : {low, high, angle}) option->capture_default_str();
  group->add_option("--bins", o.bins, "of displacement, over which starts are spread evenly")
      ->capture_default_str();
  for (CLI::Option* option :
       {group->add_option("--box-mm", command.box_mm,
                          "in place of displacements: translations along the axes of the US frame "
                          "uniform within +- this, mm"),
        group->add_option(
            "--box-deg", command.box_deg,
            "... and angles about these axes through the targets' centroid, degrees")})
    option->check(CLI::NonNegativeNumber)->excludes(low)->excludes(high)->excludes(angle);
  group->add_option("--seed", o.seed, "of the starts")->capture_default_str();
}

void add_kind_options(CLI::App& app, StudyCommand& command) {
  CLI::App* group = app.add_option_group("Kinds of trials");
  CLI::Option* negatives = group->add_flag(
      "--negatives", command.negatives,
      "all kinds of registrations that must be refused, in place of starts near the truth: with "
      "the CT of another case of the group (mismatched); of ultrasound with its lines (mirrored), "
      "its frames (frames-reversed) or both (half-turn) in reverse order; with the CT mirrored "
      "(ct-mirrored) or its second and third axes exchanged (ct-axes-swapped); without overlap "
      "(no-overlap); of speckle only (noise); from 60-100 mm (far-start); with --strangers, with "
      "their CTs (stranger)");
  group
      ->add_option("--kinds", command.kinds,
                   "only these kinds, separated by commas; 'start' is one from near the truth")
      ->delimiter(',')
      ->excludes(negatives);
  group->add_option("--strangers", command.strangers,
                    "folders of which only the CT is used, in turn, each with its kidney where "
                    "that of the case would be: cases, or folders with ct.* and targets_ct.csv, "
                    "points around the kidney (x,y,z, LPS mm)");
}

}  // namespace

void add_study_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "study",
      "Registers cases with known truth from many starts, and tells how far off the results are.\n"
      "Prints Markdown tables by group (the case's name up to its first '_') of target "
      "registration\n"
      "errors (TRE), mm, over targets.csv, against truth.tfm; and of physical errors, which are "
      "the\n"
      "distances of the targets from their positions in targets_ct.csv, deformation included. "
      "Without\n"
      "that file they are the TRE. A run succeeds if it is accepted with a TRE below 5 mm; shares "
      "are\n"
      "of all runs, so that a refusal is no success.");
  auto command = std::make_shared<StudyCommand>();
  sub->add_option("cases", command->folders, "folders as `usct phantom` writes them")->required();
  CLI::Option* preset = sub->add_option("--preset", command->preset,
                                        "options of the registration by name, see 'usct presets'");
  preset->capture_default_str();
  sub->add_option("--options", command->options,
                  "options as YAML (docs/registration_options.md); may name a preset to change")
      ->excludes(preset);
  sub->add_option("--parallel-beams", command->parallel_beams_mm,
                  "register the scan-converted ultrasound, along parallel beams on a grid of this "
                  "spacing, mm (the thesis' variant A)")
      ->check(CLI::PositiveNumber);
  add_start_options(*sub, *command);
  add_kind_options(*sub, *command);
  sub->add_option("--threads", command->threads,
                  "registrations at the same time, each on one thread [all cores]")
      ->check(CLI::PositiveNumber);
  sub->add_flag("--time", command->one_after_other,
                "one registration after the other, each on all threads, for seconds that count");
  sub->add_flag("--unjudged", command->unjudged,
                "poses without a judgement: no gate refuses any, and no evidence is gathered. For "
                "methods that had none, as the thesis'; never for what a patient is treated by");
  sub->add_flag("--thesis-table", command->thesis_table,
                "a table per case, as tables 5.1 and 5.2 of the thesis");
  sub->add_option("--output", command->output,
                  "JSON of every run, of which the script 'plot_study' draws plots");
  sub->add_option("--pictures", command->pictures,
                  "folder for pictures of the worst run of each group");
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->callback([command, &run] { run = [command] { return run_study(*command); }; });
}

}  // namespace usct::tools
