#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "exit_status.h"
#include "gold_commands.h"
#include "inputs.h"
#include "option_checks.h"
#include "ultrasound_options.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/ball_detection.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/results/points_io.h"

namespace usct::tools {
namespace {

struct GoldBallsCommand {
  std::string ct;
  std::string us;
  std::string output;
  std::optional<int> count;
  CtBallOptions in_ct;
  UsBallOptions in_us;
  double diameter_mm = 1.0;
  DicomReadOptions dicom;
  UltrasoundOptions ultrasound;
};

BallDetection detected(const GoldBallsCommand& command) {
  if (command.us.empty()) {
    CtBallOptions options = command.in_ct;
    options.diameter_mm = command.diameter_mm;
    return detect_balls(read_ct_with_warnings(command.ct, command.dicom), options);
  }
  const Ultrasound us = read_ultrasound_with_warnings(command.ultrasound.source(command.us));
  const auto* volume = std::get_if<PreScanVolume>(&us);
  if (!volume)
    throw InputError(command.us,
                     "is not pre-scan ultrasound, must have beams: balls echo at their tops along "
                     "the beam");
  UsBallOptions options = command.in_us;
  options.diameter_mm = command.diameter_mm;
  return detect_balls(*volume, options);
}

int run_gold_balls(const GoldBallsCommand& command) {
  if (command.ct.empty() == command.us.empty())
    throw InputError("gold balls",
                     command.ct.empty() ? "needs a CT or --us" : "takes a CT or --us, not both");
  if (!command.output.empty()) require_place_ending("--output", command.output, ".csv");
  BallDetection found = detected(command);
  for (const RefusedBall& one : found.refused)
    std::fprintf(stderr, "usct: warning: the object at (%.2f, %.2f, %.2f) mm %s: left out\n",
                 one.centre_mm.x(), one.centre_mm.y(), one.centre_mm.z(), one.reason.c_str());
  const std::size_t number = found.balls.size();
  // Echoes of bubbles look like those of balls; the brightest are the best guess.
  if (command.count && !command.us.empty() && number > static_cast<std::size_t>(*command.count))
    found.balls.resize(static_cast<std::size_t>(*command.count));
  std::printf("ball | x mm | y mm | z mm | contrast%s\n", command.us.empty() ? " HU" : "");
  std::vector<Eigen::Vector3d> centres_mm;
  for (const DetectedBall& ball : found.balls) {
    centres_mm.push_back(ball.centre_mm);
    std::printf("%4zu | %.3f | %.3f | %.3f | %.0f\n", centres_mm.size(), ball.centre_mm.x(),
                ball.centre_mm.y(), ball.centre_mm.z(), ball.contrast);
  }
  if (command.count && centres_mm.size() != static_cast<std::size_t>(*command.count))
    throw InputError("--count",
                     formatted("is %d, but %zu balls were found", *command.count, number));
  if (centres_mm.empty())
    throw InputError(command.us.empty() ? command.ct : command.us,
                     formatted("no ball of %g mm was found in it", command.diameter_mm));
  if (!command.output.empty()) write_points_mm(centres_mm, command.output);
  return kDone;
}

}  // namespace

void add_gold_balls(CLI::App& gold, Run& run) {
  auto options = std::make_shared<GoldBallsCommand>();
  CLI::App* command = gold.add_subcommand(
      "balls",
      "Finds steel balls of a known diameter in a CT or in pre-scan ultrasound and writes their "
      "centres, in no order, for `usct gold fiducials --match`.");
  CLI::Option* ct = command->add_option("CT", options->ct, "the CT: file or DICOM folder");
  CLI::Option* us = command->add_option("--us", options->us, "pre-scan ultrasound instead of a CT");
  command->add_option("--diameter", options->diameter_mm, "of the balls, mm")
      ->capture_default_str();
  command
      ->add_option("--count", options->count,
                   "number of balls: of the ultrasound's echoes, those that stand out most; else "
                   "another number is an error")
      ->check(within(1, 1000));
  command
      ->add_option("--least-hu", options->in_ct.least_contrast_hu,
                   "CT: mean HU above the surroundings, within the diameter, that make a ball")
      ->needs(ct)
      ->capture_default_str();
  command
      ->add_option("--least-contrast", options->in_us.least_contrast,
                   "ultrasound: grey values by which an echo exceeds its surroundings")
      ->needs(us)
      ->capture_default_str();
  command
      ->add_option("--echo-radius", options->in_us.echo_radius_mm,
                   "ultrasound: where the surroundings of an echo begin, mm")
      ->needs(us)
      ->capture_default_str();
  command->add_option("--output", options->output, "CSV to write, .csv, with the header x,y,z, mm");
  all_need(ct, *add_dicom_options(*command, options->dicom));
  all_need(us, *options->ultrasound.add_to(*command));
  command->callback([options, &run] { run = [options] { return run_gold_balls(*options); }; });
}

}  // namespace usct::tools
