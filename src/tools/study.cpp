#include <algorithm>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "exit_status.h"
#include "option_checks.h"
#include "study_pictures.h"
#include "study_progress.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/study_file.h"
#include "us_ct_registration/evaluation/study_report.h"
#include "us_ct_registration/evaluation/study_work.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/threads.h"

namespace usct::tools {
namespace {

namespace fs = std::filesystem;

struct StudyCommand {
  /// A study file, or folders of cases. Most other options describe a study of cases; a study file
  /// says the same itself.
  std::vector<std::string> inputs;
  std::vector<CLI::Option*> of_cases;
  std::vector<CLI::Option*> of_file;

  std::vector<std::string> strangers;
  StudyOptions starts;
  std::uint32_t seed = 1;
  bool negatives = false;
  std::vector<std::string> kinds;
  double max_rotation_deg = 30.0;
  double box_mm = -1.0;
  double box_deg = -1.0;
  std::string preset = "patient";
  std::string options;
  double parallel_beams_mm = 0.0;
  bool one_at_a_time = false;
  bool thesis_table = false;
  bool unjudged = false;

  std::string root;
  std::string shard = "1/1";

  int threads = thread_count();
  std::string output;
  std::string pictures;
  bool profiles = false;
  bool quiet = false;

  bool has_extras() const { return profiles || !pictures.empty(); }
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

StudyMethod method_of(const StudyCommand& command) {
  StudyMethod method;
  method.name = command.options.empty() ? command.preset : "options";
  method.options =
      command.options.empty() ? preset(command.preset) : read_registration_options(command.options);
  if (command.unjudged) method.options.confidence.gates = GateLimits::none();
  if (command.parallel_beams_mm > 0.0) method.parallel_beams_mm = command.parallel_beams_mm;
  return method;
}

/// The study that the options describe.
Study study_of_cases(const StudyCommand& command) {
  Study study;
  study.cases.assign(command.inputs.begin(), command.inputs.end());
  study.strangers.assign(command.strangers.begin(), command.strangers.end());
  study.methods = {method_of(command)};
  study.starts = command.starts;
  study.starts.seeds = {command.seed};
  if (command.negatives || !command.kinds.empty()) study.starts.kinds = kinds_of(command);
  study.starts.max_rotation_rad = command.max_rotation_deg * kDegree;
  if (command.box_mm >= 0.0 || command.box_deg >= 0.0)
    study.starts.box =
        MotionBox{std::max(0.0, command.box_deg) * kDegree, std::max(0.0, command.box_mm)};
  if (command.one_at_a_time) study.how = StudyThreads::kWithinTrial;
  study.validate("usct study");
  return study;
}

void refuse(const std::vector<CLI::Option*>& options, const std::string& why) {
  for (const CLI::Option* option : options)
    if (option->count() > 0) throw InputError(option->get_name(), why);
}

std::vector<Register> registers_of(const Study& study) {
  std::vector<Register> methods;
  for (const StudyMethod& method : study.methods) methods.push_back(registers_with(method));
  return methods;
}

StudyWork work_of(const StudyCommand& command) {
  StudyWork work;
  work.shard = parse_shard(command.shard, "--shard");
  work.threads = command.threads;
  work.progress = study_progress(command.quiet);
  work.warn = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  return work;
}

/// The runs, or none if some are not there.
std::vector<StudyRun> all_of(std::vector<std::optional<StudyRun>> known) {
  std::vector<StudyRun> runs;
  for (std::optional<StudyRun>& run : known)
    if (run) runs.push_back(std::move(*run));
  if (runs.size() < known.size()) {
    std::printf("%zu of %zu runs of the study are done; the rest belongs to other shards.\n",
                runs.size(), known.size());
    runs.clear();
  }
  return runs;
}

StudyExtras extras_of(const StudyCommand& command, const StudyPlan& plan, const CaseSource& cases,
                      const std::vector<StudyRun>& runs) {
  StudyExtras extras;
  if (!command.pictures.empty())
    extras.pictures = write_study_pictures(plan.study, cases, runs, command.pictures);
  if (command.profiles) {
    const ThreadCount of_loops(command.threads);
    extras.profiles = study_profiles(plan, cases);
  }
  return extras;
}

/// Carries out the study of a file, in its folder of results.
int run_file(const StudyCommand& command) {
  refuse(command.of_cases, "belongs into the study file, must not be given beside it");
  const fs::path file = command.inputs.front();
  const fs::path root = command.root.empty() ? file.parent_path() : fs::path(command.root);
  const StudyPlan plan = plan_study(read_study(file, root));
  require_picture_folder(command.pictures);
  StudyWork work = work_of(command);
  work.folder = command.output.empty() ? root / file.stem() : fs::path(command.output);
  const CaseSource cases = case_reader(plan.study);
  const std::vector<StudyRun> runs = all_of(carry_out(plan, cases, registers_of(plan.study), work));
  if (runs.empty()) return kDone;
  write_study_report(plan, runs, {}, work.folder);
  std::printf("%s\n%s", tables_markdown(result_tables(plan.study, runs)).c_str(),
              tables_markdown({costs_table(plan.study, runs)}).c_str());
  // Pictures and profiles come last, since they take seconds each.
  if (command.has_extras())
    write_study_json(plan, runs, extras_of(command, plan, cases, runs), work.folder / "study.json");
  return kDone;
}

void print_tables(const StudyCommand& command, const StudyPlan& plan, const CaseSource& cases,
                  const std::vector<StudyRun>& runs) {
  const std::string negatives = markdown(negatives_table(runs));
  std::printf("%s", negatives.c_str());
  const std::vector<TrialKind>& kinds = plan.study.starts.kinds;
  if (std::find(kinds.begin(), kinds.end(), TrialKind::kStart) == kinds.end()) return;
  if (!negatives.empty()) std::printf("\n");
  const std::vector<double> edges_mm = bin_edges_mm(plan.study.starts, runs);
  std::printf("%s\n", markdown(accuracy_table(runs, edges_mm)).c_str());
  BeamOptions beams;
  beams.parallel_beams_mm = plan.study.methods.front().parallel_beams_mm;
  if (command.thesis_table)
    std::printf("%s\n", markdown(thesis_table(plan, cases, runs, beams)).c_str());
  std::printf("%s", markdown(calibration_table(runs)).c_str());
}

/// Places are checked and made first, since hours of work must not be lost at the end.
void require_places(const StudyCommand& command) {
  if (command.output.empty()) return;
  const fs::path folder = fs::absolute(command.output).parent_path();
  if (!fs::is_directory(folder))
    throw InputError("--output",
                     "lies in '" + folder.string() + "', must be in a folder that exists");
  if (fs::path(command.output).extension() != ".json")
    throw InputError("--output", "is '" + command.output + "', must end in .json");
  require_writable(command.output);
}

int run_cases(const StudyCommand& command) {
  refuse(command.of_file, "is for a study file, must not be given with cases");
  const Study study = study_of_cases(command);
  if (command.profiles && command.output.empty())
    throw InputError("--profiles", "is given without --output, the file that they go into");
  require_places(command);
  require_picture_folder(command.pictures);
  const StudyPlan plan = plan_study(study);
  const CaseSource cases = case_reader(study);
  const std::vector<StudyRun> runs =
      all_of(carry_out(plan, cases, registers_of(study), work_of(command)));
  print_tables(command, plan, cases, runs);
  if (!command.output.empty()) write_study_json(plan, runs, {}, command.output);
  // Pictures and profiles come last, since they take seconds each.
  if (!command.has_extras()) return kDone;
  const StudyExtras extras = extras_of(command, plan, cases, runs);
  if (!command.output.empty()) write_study_json(plan, runs, extras, command.output);
  return kDone;
}

int run_study(const StudyCommand& command) {
  if (!fs::exists(command.inputs.front()))
    throw InputError(command.inputs.front(), "does not exist");
  const bool is_file = fs::is_regular_file(command.inputs.front());
  if (is_file && command.inputs.size() > 1)
    throw InputError(command.inputs.front(), "is a study file, must be given alone");
  return is_file ? run_file(command) : run_cases(command);
}

void add_start_options(CLI::App& app, StudyCommand& command) {
  CLI::App* group = app.add_option_group("Starts");
  StudyOptions& o = command.starts;
  CLI::Option* low = group->add_option("--min-displacement", o.min_displacement_mm,
                                       "least mean displacement of the targets, mm");
  CLI::Option* high = group->add_option("--max-displacement", o.max_displacement_mm,
                                        "largest mean displacement of the targets, mm");
  CLI::Option* angle = group->add_option("--max-rotation-deg", command.max_rotation_deg,
                                         "largest rotation, degrees");
  CLI::Option* box_mm = group->add_option(
      "--box-mm", command.box_mm,
      "in place of displacements: translations along the axes of the US frame uniform within +- "
      "this, mm");
  CLI::Option* box_deg =
      group->add_option("--box-deg", command.box_deg,
                        "... and angles about these axes through the targets' centroid, degrees");
  const std::vector<CLI::Option*> others{
      group->add_option("--starts", o.starts, "per case and kind of trial"),
      group->add_option("--bins", o.bins, "of displacement, over which starts are spread evenly"),
      group->add_option("--seed", command.seed, "of the starts")};
  for (CLI::Option* option : {box_mm, box_deg})
    option->excludes(low)->excludes(high)->excludes(angle);
  box_mm->check(at_least(0));
  for (CLI::Option* option : {angle, box_deg}) option->check(within(0.0, 180.0));
  for (CLI::Option* option : {low, high, angle}) option->capture_default_str();
  for (CLI::Option* option : others) option->capture_default_str();
  command.of_cases.insert(command.of_cases.end(), {low, high, angle, box_mm, box_deg});
  command.of_cases.insert(command.of_cases.end(), others.begin(), others.end());
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
  CLI::Option* kinds = group->add_option(
      "--kinds", command.kinds,
      "only these kinds, separated by commas; 'start' is one from near the truth");
  kinds->delimiter(',')->excludes(negatives);
  CLI::Option* strangers = group->add_option(
      "--strangers", command.strangers,
      "folders of which only the CT is used, in turn, each with its kidney where that of the case "
      "would be: cases, or folders with ct.* and targets_ct.csv, points around the kidney (x,y,z, "
      "LPS mm)");
  command.of_cases.insert(command.of_cases.end(), {negatives, kinds, strangers});
}

void add_method_options(CLI::App& app, StudyCommand& command) {
  CLI::Option* preset = app.add_option("--preset", command.preset,
                                       "options of the registration by name, see 'usct presets'");
  preset->capture_default_str();
  CLI::Option* options =
      app.add_option("--options", command.options,
                     "options as YAML (docs/registration_options.md); may name a preset to change");
  options->excludes(preset);
  CLI::Option* beams = app.add_option(
      "--parallel-beams", command.parallel_beams_mm,
      "register the scan-converted ultrasound, along parallel beams on a grid of this spacing, mm "
      "(the thesis' variant A)");
  beams->check(within(0.05, 10.0));
  CLI::Option* alone =
      app.add_flag("--time", command.one_at_a_time,
                   "one registration after the other, each on all threads, for seconds that count");
  CLI::Option* unjudged = app.add_flag(
      "--unjudged", command.unjudged,
      "poses without a judgement: no gate refuses any, and no evidence is gathered. For methods "
      "that had none, as the thesis'; never for what a patient is treated by");
  CLI::Option* thesis = app.add_flag("--thesis-table", command.thesis_table,
                                     "a table per case, as tables 5.1 and 5.2 of the thesis");
  command.of_cases.insert(command.of_cases.end(),
                          {preset, options, beams, alone, unjudged, thesis});
}

void add_file_options(CLI::App& app, StudyCommand& command) {
  CLI::App* group = app.add_option_group("Study files");
  command.of_file = {
      group->add_option("--root", command.root,
                        "folder at which relative folders of cases begin [that of the study file]"),
      group->add_option("--shard", command.shard,
                        "part K of N parts of the study, written K/N, for several machines with a "
                        "common folder of results")};
}

}  // namespace

void add_study_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "study",
      "Registers cases with known truth from many starts, and tells how far off the results are.\n"
      "`usct study STUDY.yaml` carries out a study of several methods that a file describes\n"
      "(docs/studies.md), and goes on where it was ended; `usct study CASE...` one of a single\n"
      "method that the options describe. The latter prints Markdown tables by group (the case's\n"
      "name up to its first '_') of target registration errors (TRE), mm, over targets.csv, "
      "against\n"
      "truth.tfm; and of physical errors, which are the distances of the targets from their\n"
      "positions in targets_ct.csv, deformation included. Without that file they are the TRE. A\n"
      "run succeeds if it is accepted with a TRE below 5 mm; shares are of all runs, so that a\n"
      "refusal is no success.");
  auto command = std::make_shared<StudyCommand>();
  sub->add_option("inputs", command->inputs,
                  "a study file, or folders as `usct phantom` writes them")
      ->required();
  add_method_options(*sub, *command);
  add_start_options(*sub, *command);
  add_kind_options(*sub, *command);
  add_file_options(*sub, *command);
  sub->add_option("--threads", command->threads,
                  "registrations at the same time, each on one thread [all cores]")
      ->check(within(1, 1024));
  sub->add_option(
      "--output", command->output,
      "of a study file: folder of the results [its name, below the root]; of cases: JSON "
      "of every run. The script 'study_report' makes a page of the JSON of either");
  sub->add_option("--pictures", command->pictures,
                  "folder for pictures of the worst run of each group");
  sub->add_flag("--profiles", command->profiles,
                "also evaluates the similarity of each method along six axes through the truth of "
                "each case, for the JSON and the page");
  sub->add_flag("--quiet", command->quiet, "no progress on standard error");
  sub->callback([command, &run] { run = [command] { return run_study(*command); }; });
}

}  // namespace usct::tools
