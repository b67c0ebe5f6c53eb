#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "exit_status.h"
#include "gold_commands.h"
#include "option_checks.h"
#include "us_ct_registration/baselines/icp.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/surface_standard.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::tools {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

struct GoldIcpCommand {
  std::string us;
  std::string ct;
  std::string initial;
  std::string output;
  IcpOptions icp;
};

double turn_rad(const IcpResult& a, const IcpResult& b) {
  return Eigen::AngleAxisd(a.T_us_ct.linear().transpose() * b.T_us_ct.linear()).angle();
}

/// The results that are others than better ones, best first.
std::vector<IcpResult> distinct(std::vector<IcpResult> results) {
  constexpr double kSameRad = 20.0 * kDegree;
  std::sort(results.begin(), results.end(), [](const IcpResult& a, const IcpResult& b) {
    return a.capped_distance_mm < b.capped_distance_mm;
  });
  std::vector<IcpResult> kept;
  for (const IcpResult& result : results)
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const IcpResult& better) { return turn_rad(better, result) <= kSameRad; }))
      kept.push_back(result);
  return kept;
}

/// ICP from the initial pose, or from all alignments of the principal axes. From some of these the
/// surfaces may not overlap; it is an error if they do from none.
std::vector<IcpResult> results_of(const GoldIcpCommand& command, const Points& us,
                                  const Points& ct) {
  const auto from = [&](const Isometry3d& start) {
    return icp(us, ct, start, command.icp, command.us, command.ct);
  };
  if (!command.initial.empty()) return {from(read_T_us_ct(command.initial))};
  std::vector<IcpResult> results;
  std::optional<InputError> last;
  for (const Isometry3d& start : axis_alignments(us, ct, command.us, command.ct)) {
    try {
      results.push_back(from(start));
    } catch (const InputError& error) {
      last = error;
    }
  }
  if (results.empty()) throw *last;
  return distinct(std::move(results));
}

/// Infinite if all starts led to the same.
double distinction(const std::vector<IcpResult>& results) {
  if (results.size() < 2) return std::numeric_limits<double>::infinity();
  return distinction_of(results[0].capped_distance_mm, results[1].capped_distance_mm);
}

void warn_of_motion(const IcpResult& best) {
  const SurfaceMotion& open = best.least_determined;
  std::fprintf(
      stderr,
      "usct: warning: the surfaces leave a motion undetermined (information %.5f): a shift "
      "along (%.2f, %.2f, %.2f) with a turn of (%.3f, %.3f, %.3f) rad per mm about "
      "(%.1f, %.1f, %.1f) in the US frame. The start and noise decide it\n",
      best.least_information, open.shift[0], open.shift[1], open.shift[2], open.turn[0],
      open.turn[1], open.turn[2], best.centre_us_mm[0], best.centre_us_mm[1], best.centre_us_mm[2]);
}

int run_gold_icp(const GoldIcpCommand& command) {
  if (!command.output.empty()) require_transform_place("--output", command.output);
  const Points us = read_points_mm(command.us);
  const Points ct = read_points_mm(command.ct);
  const std::vector<IcpResult> results = results_of(command, us, ct);
  std::printf(
      "alignment | all points mm | pairs from the surface mm | from the points mm | pairs | "
      "iterations | turned\n");
  for (std::size_t i = 0; i < results.size(); ++i)
    std::printf("%9zu | %13.3f | %25.3f | %18.3f | %5d | %10d | %.0f degrees\n", i + 1,
                results[i].capped_distance_mm, results[i].plane_distance_mm, results[i].distance_mm,
                results[i].pairs, results[i].iterations,
                turn_rad(results[0], results[i]) / kDegree);
  const IcpResult& best = results[0];
  std::printf("predicted error of the surface from independent errors of its points: %.3f mm\n",
              best.predicted_error_mm);
  if (!best.converged)
    std::fprintf(stderr, "usct: warning: not converged after %d iterations\n", best.iterations);
  if (best.undetermined()) warn_of_motion(best);
  warn_of_distinction(distinction(results));
  if (!command.output.empty()) write_T_us_ct(best.T_us_ct, command.output);
  return kDone;
}

}  // namespace

void add_gold_icp(CLI::App& gold, Run& run) {
  auto options = std::make_shared<GoldIcpCommand>();
  CLI::App* command = gold.add_subcommand(
      "icp",
      "Bronze standard from surfaces of which one image may show a part only (iterative closest "
      "points), from an initial pose or from the 24 alignments of the principal axes.");
  command
      ->add_option(
          "US", options->us,
          "the first file, CSV with the header x,y,z: points of the surface in the US frame, "
          "mm")
      ->required();
  command->add_option("CT", options->ct, "the second file, the same in the CT's frame, LPS, mm")
      ->required();
  command->add_option("--initial", options->initial,
                      "ITK transform from US to CT points to start from (.tfm, .txt, .h5)");
  command
      ->add_option("--overlap", options->icp.overlap,
                   "share of the ultrasound's points that the CT shows as well")
      ->capture_default_str();
  command
      ->add_option("--largest-distance", options->icp.largest_distance_mm,
                   "pairs farther apart do not count, mm")
      ->capture_default_str();
  command
      ->add_option("--iterations", options->icp.largest_iterations, "largest number of iterations")
      ->capture_default_str();
  command->add_option("--output", options->output,
                      "transform to write, as `usct register` does (.tfm, .txt, .h5)");
  command->callback([options, &run] { run = [options] { return run_gold_icp(*options); }; });
}

}  // namespace usct::tools
