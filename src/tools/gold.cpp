#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "exit_status.h"
#include "gold_commands.h"
#include "option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/fiducial_matching.h"
#include "us_ct_registration/evaluation/fiducial_standard.h"
#include "us_ct_registration/evaluation/surface_standard.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::tools {
namespace {

using Points = std::vector<Eigen::Vector3d>;

struct GoldCommand {
  std::string us;
  std::string ct;
  std::string targets;
  std::string output;
  bool match = false;
  double fle_mm = 1.0;
};

/// Fiducials of ultrasound and CT, pair by pair, and which points of their files they are, from 0.
struct PairedFiducials {
  Points us_mm;
  Points ct_mm;
  std::vector<std::pair<std::size_t, std::size_t>> rows;
};

PairedFiducials paired_fiducials(const GoldCommand& command) {
  std::pair<Points, Points> points{read_points_mm(command.us), read_points_mm(command.ct)};
  PairedFiducials paired{points.first, points.second, {}};
  for (std::size_t i = 0; i < paired.us_mm.size(); ++i) paired.rows.emplace_back(i, i);
  if (!command.match) return paired;
  const FiducialMatching matching =
      match_fiducials(points.first, points.second, command.fle_mm, command.us + ", " + command.ct);
  if (matching.ambiguous())
    std::fprintf(stderr,
                 "usct: warning: %zu pairings fit a localization error of %g mm (FRE %.3f mm, the "
                 "second %.3f mm): the order of the fiducials is ambiguous\n",
                 matching.fitting.size(), command.fle_mm, matching.fitting[0].fre_mm,
                 matching.fitting[1].fre_mm);
  std::tie(paired.us_mm, paired.ct_mm) =
      matched_points(matching.fitting[0], points.first, points.second);
  paired.rows.assign(matching.fitting[0].pairs.begin(), matching.fitting[0].pairs.end());
  return paired;
}

int run_fiducials(const GoldCommand& command) {
  if (!command.output.empty()) require_transform_place("--output", command.output);
  const PairedFiducials paired = paired_fiducials(command);
  const FiducialStandard standard =
      fiducial_standard(paired.us_mm, paired.ct_mm, command.us, command.ct);
  std::printf("point of ultrasound | point of CT | residual mm | left out mm\n");
  for (std::size_t i = 0; i < standard.fiducials.size(); ++i) {
    const FiducialResidual& one = standard.fiducials[i];
    std::printf("%19zu | %11zu | %11.3f | ", paired.rows[i].first + 1, paired.rows[i].second + 1,
                one.residual_mm);
    one.left_out_mm ? std::printf("%11.3f\n", *one.left_out_mm) : std::printf("%11s\n", "-");
  }
  std::printf("FRE %.3f mm, FLE %.3f mm (RMS, from %zu fiducials)\n", standard.fre_mm,
              standard.fle_mm, standard.fiducials.size());
  std::printf("predicted TRE at the fiducials' centroid: %.3f mm\n",
              standard.predicted_tre_mm(standard.centroid_us_mm));
  if (!command.targets.empty()) {
    double sum = 0.0;
    double most = 0.0;
    const Points targets = read_points_mm(command.targets);
    for (const Eigen::Vector3d& target : targets) {
      const double tre = standard.predicted_tre_mm(target);
      sum += tre;
      most = std::max(most, tre);
    }
    std::printf("predicted TRE at %zu targets: mean %.3f mm, largest %.3f mm\n", targets.size(),
                sum / static_cast<double>(targets.size()), most);
  }
  if (!command.output.empty()) write_T_us_ct(standard.T_us_ct, command.output);
  return kDone;
}

int run_surfaces_standard(const GoldCommand& command) {
  constexpr double kLeastRatio = 1.05;
  if (!command.output.empty()) require_transform_place("--output", command.output);
  const SurfaceStandard standard = surface_standard(
      read_points_mm(command.us), read_points_mm(command.ct), command.us, command.ct);
  std::printf("alignment | distance of the surfaces mm | turned from the best\n");
  const Eigen::Matrix3d best = standard.alignments[0].T_us_ct.linear();
  for (std::size_t i = 0; i < standard.alignments.size(); ++i) {
    const SurfaceAlignment& one = standard.alignments[i];
    const double turn_rad = Eigen::AngleAxisd(best.transpose() * one.T_us_ct.linear()).angle();
    std::printf("%9zu | %27.3f | %.0f degrees\n", i + 1, one.distance_mm, turn_rad / kDegree);
  }
  std::printf(
      "standard deviations along the principal axes: ultrasound %.2f, %.2f, %.2f mm; "
      "CT %.2f, %.2f, %.2f mm\n",
      standard.deviations_us_mm[0], standard.deviations_us_mm[1], standard.deviations_us_mm[2],
      standard.deviations_ct_mm[0], standard.deviations_ct_mm[1], standard.deviations_ct_mm[2]);
  warn_of_distinction(standard.distinction());
  if (standard.roundness_ratio() < kLeastRatio)
    std::fprintf(stderr,
                 "usct: warning: two principal axes are nearly equal (ratio %.3f): the rotation "
                 "about the third is arbitrary\n",
                 standard.roundness_ratio());
  if (!command.output.empty()) write_T_us_ct(standard.alignments[0].T_us_ct, command.output);
  return kDone;
}

/// Adds the subcommand `name` of `gold`, of two files of points.
void add_standard(CLI::App& gold, Run& run, const std::string& name, const std::string& description,
                  int (*work)(const GoldCommand&)) {
  auto options = std::make_shared<GoldCommand>();
  CLI::App* command = gold.add_subcommand(name, description);
  command
      ->add_option("US", options->us,
                   "the first file, CSV with the header x,y,z: points in the US frame, mm")
      ->required();
  command->add_option("CT", options->ct, "the second file, the same in the CT's frame, LPS, mm")
      ->required();
  if (name == "fiducials") {
    command->add_option("--targets", options->targets,
                        "CSV of points in the US frame at which to predict the error, mm");
    CLI::Option* match = command->add_flag(
        "--match", options->match,
        "pair the points by their mutual distances: their order is not known, and one file may "
        "have points that the other lacks");
    command
        ->add_option("--fle", options->fle_mm,
                     "localization error, both images together, that a pairing may have, mm")
        ->needs(match)
        ->capture_default_str();
  }
  command->add_option("--output", options->output,
                      "transform to write, as `usct register` does (.tfm, .txt, .h5)");
  command->callback([options, work, &run] { run = [options, work] { return work(*options); }; });
}

}  // namespace

void warn_of_distinction(double ratio) {
  if (ratio < kLeastDistinction)
    std::fprintf(stderr,
                 "usct: warning: the second alignment fits nearly as well (%.2f times the "
                 "distance): the surfaces do not tell which way round the kidney is\n",
                 ratio);
}

void add_gold_command(CLI::App& app, Run& run) {
  CLI::App* gold = app.add_subcommand(
      "gold",
      "Alignments to measure registrations against, from points or surfaces in both images.");
  gold->require_subcommand(1);
  add_standard(*gold, run, "fiducials",
               "Gold standard from fiducials, in the same order in both files or --match (Horn): "
               "residuals, localization error, predicted error at targets.",
               run_fiducials);
  add_standard(*gold, run, "surfaces",
               "Bronze standard from points spread over the kidney's surface in both images "
               "(principal axes): the four possible alignments, best first.",
               run_surfaces_standard);
  add_gold_icp(*gold, run);
  add_gold_balls(*gold, run);
}

}  // namespace usct::tools
