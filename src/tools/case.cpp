#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "inputs.h"
#include "landmark_warning.h"
#include "ultrasound_options.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/fiducial_standard.h"
#include "us_ct_registration/evaluation/study_case.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/whole_folder.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::tools {
namespace {

using Points = std::vector<Eigen::Vector3d>;

struct CaseCommand {
  std::string ct;
  DicomReadOptions dicom;
  std::string us;
  UltrasoundOptions ultrasound;
  /// Files of the same points in the CT and in the ultrasound.
  std::vector<std::string> landmarks;
  std::string truth;
  std::string targets;
  std::string targets_ct;
  std::string output;
};

PreScanVolume read_beams(const CaseCommand& command) {
  Ultrasound ultrasound = read_ultrasound_with_warnings(command.ultrasound.source(command.us));
  auto* beams = std::get_if<PreScanVolume>(&ultrasound);
  if (std::holds_alternative<UsVolume>(ultrasound))
    throw InputError(command.us,
                     "is a Cartesian volume, must have beams: give the sweep that it was made of");
  if (beams == nullptr)
    throw InputError(command.us,
                     "holds images whose beams are not known, must have beams: give --probe, "
                     "--image-origin, --image-spacing and --samples");
  return std::move(*beams);
}

/// The landmarks in the CT and in the ultrasound, each of which must lie in its image.
std::pair<Points, Points> read_landmarks(const CaseCommand& command, const StudyCase& made) {
  std::pair<Points, Points> points{read_points_mm(command.landmarks[0]),
                                   read_points_mm(command.landmarks[1])};
  require_in_images({command.landmarks[0], points.first}, {command.landmarks[1], points.second},
                    made.ct, beam_grid(made.ultrasound.geometry));
  return points;
}

/// How exact the truth is where errors will be measured.
void print(const FiducialStandard& standard, const Points& targets_us_mm) {
  double squares = 0.0;
  for (const Eigen::Vector3d& target : targets_us_mm)
    squares += std::pow(standard.predicted_tre_mm(target), 2.0) /
               static_cast<double>(targets_us_mm.size());
  std::printf(
      "truth from %zu landmarks: FRE %.2f mm, FLE %.2f mm, expected error at the %zu targets %.2f "
      "mm (RMS)\n",
      standard.fiducials.size(), standard.fre_mm, standard.fle_mm, targets_us_mm.size(),
      std::sqrt(squares));
}

/// Sets the truth by landmarks, which are the targets unless others are given.
FiducialStandard set_truth_by_landmarks(const CaseCommand& command, StudyCase& made) {
  std::tie(made.targets_ct_mm, made.targets_us_mm) = read_landmarks(command, made);
  FiducialStandard standard = fiducial_standard(made.targets_us_mm, made.targets_ct_mm,
                                                command.landmarks[1], command.landmarks[0]);
  made.T_us_ct_true = standard.T_us_ct;
  warn_of_landmarks({command.landmarks[0], made.targets_ct_mm},
                    {command.landmarks[1], made.targets_us_mm}, standard.fre_mm);
  return standard;
}

/// Sets targets that are no landmarks; returns whether their positions in the CT are known.
bool set_targets(const CaseCommand& command, StudyCase& made) {
  if (command.targets.empty()) return true;
  made.targets_us_mm = read_points_mm(command.targets);
  const bool in_ct = !command.targets_ct.empty();
  made.targets_ct_mm = in_ct ? read_points_mm(command.targets_ct)
                             : ct_points_mm(made.T_us_ct_true, made.targets_us_mm);
  require_same_count(command.targets_ct, made.targets_ct_mm.size(), command.targets,
                     made.targets_us_mm.size());
  // A kidney may reach beyond either image; its middle may not.
  require_in_ultrasound({made.centre_us_mm()}, beam_grid(made.ultrasound.geometry),
                        command.targets + ", centroid");
  require_in_ct({made.centre_ct_mm()}, made.ct, command.targets + ", centroid by the truth");
  return in_ct;
}

int run_case(const CaseCommand& command) {
  if (command.landmarks.empty() == command.truth.empty())
    throw InputError("--landmarks", "or --truth must be given, and not both");
  if (!command.truth.empty() && command.targets.empty())
    throw InputError("--targets", "is missing, must be given with --truth");
  require_new_folder(command.output);
  StudyCase made;
  made.ct = read_ct_with_warnings(command.ct, command.dicom);
  made.ultrasound = read_beams(command);
  std::optional<FiducialStandard> standard;
  if (command.landmarks.empty())
    made.T_us_ct_true = read_T_us_ct(command.truth);
  else
    standard = set_truth_by_landmarks(command, made);
  const bool with_targets_ct = set_targets(command, made);
  if (standard) print(*standard, made.targets_us_mm);
  write_study_case(made, command.output, with_targets_ct);
  std::printf("%s\n", command.output.c_str());
  return kDone;
}

void add_truth_options(CLI::App& app, CaseCommand& command) {
  CLI::App* group = app.add_option_group("Truth and targets");
  CLI::Option* truth = group->add_option(
      "--truth", command.truth, "true pose, such as `usct gold` writes it: US to CT points, mm");
  group
      ->add_option("--landmarks", command.landmarks,
                   "two CSV files x,y,z of the same points in the CT (LPS, mm) and in the US frame "
                   "(mm), in the same order: the truth aligns them, and they are the targets")
      ->expected(2)
      ->excludes(truth);
  CLI::Option* targets = group->add_option(
      "--targets", command.targets,
      "CSV of points at which errors count, such as the kidney's surface, US frame, mm");
  group
      ->add_option("--targets-ct", command.targets_ct,
                   "the same points as they were marked in the CT: the error then includes what "
                   "deformed")
      ->needs(targets);
}

}  // namespace

void add_case_command(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand(
      "case",
      "Makes a case of your own CT and ultrasound for `usct study` (docs/evaluate_your_data.md): a "
      "folder with ct.nrrd, us.nrrd, truth.tfm, targets.csv and targets_ct.csv. The truth comes "
      "from landmarks in both images or from a transform. Points outside their image are refused.");
  auto command = std::make_shared<CaseCommand>();
  sub->add_option("--ct", command->ct, "DICOM folder or file, NRRD, MetaImage or NIfTI")
      ->required();
  sub->add_option("--us", command->us, "ultrasound of any kind that 'usct info' knows, with beams")
      ->required();
  sub->add_option("--output", command->output,
                  "folder to write; must be absent or empty. Its name up to the first '_' is the "
                  "group of the case in tables")
      ->required();
  add_truth_options(*sub, *command);
  add_dicom_options(*sub, command->dicom);
  command->ultrasound.add_to(*sub);
  sub->callback([command, &run] { run = [command] { return run_case(*command); }; });
}

}  // namespace usct::tools
