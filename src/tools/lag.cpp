#include <cstdio>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "exit_status.h"
#include "ultrasound_options.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct::tools {
namespace {

struct LagOptions {
  std::string path;
  UltrasoundOptions ultrasound;
  bool json = false;
};

LagEstimate estimate(const Ultrasound& ultrasound, const std::string& path) {
  if (const auto* volume = std::get_if<PreScanVolume>(&ultrasound)) return estimate_lag(*volume);
  if (const auto* images = std::get_if<TrackedImages>(&ultrasound)) return estimate_lag(*images);
  throw InputError(path, "is a Cartesian volume: it has no frames, must be a tracked sweep");
}

nlohmann::ordered_json to_json(const LagEstimate& lag) {
  return {{"determined", lag.determined},
          {"message", lag.message},
          {"lag_s", lag.lag_s},
          {"standard_error_s", lag.standard_error_s},
          {"interval_s", {lag.interval_s.first, lag.interval_s.second}},
          {"correlation", lag.correlation},
          {"next_correlation", lag.next_correlation},
          {"significance", lag.significance},
          {"speed_variation", lag.speed_variation},
          {"pairs", lag.pairs},
          {"repeated_images", lag.repeated_images}};
}

void print(const LagEstimate& lag) {
  if (lag.determined)
    std::printf("images lag poses by %.3f s (standard error %.3f s, 95 %% from %.3f to %.3f s)\n",
                lag.lag_s, lag.standard_error_s, lag.interval_s.first, lag.interval_s.second);
  else
    std::printf("not determinable: %s\n", lag.message.c_str());
  std::printf(
      "correlation %.2f there, %.2f at the next peak; %.1f standard deviations above chance\n",
      lag.correlation, lag.next_correlation, lag.significance);
  std::printf("speed varies by %.0f %%; %d pairs of frames, %d repeated images\n",
              100.0 * lag.speed_variation, lag.pairs, lag.repeated_images);
}

int run_lag(const LagOptions& options) {
  const UltrasoundSource source = options.ultrasound.source(options.path);
  const LagEstimate lag = estimate(read_ultrasound_with_warnings(source), options.path);
  if (options.json)
    std::printf("%s\n", to_json(lag).dump(2).c_str());
  else
    print(lag);
  return kDone;
}

}  // namespace

void add_lag_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "lag",
      "Estimates by how much the images of a tracked sweep lag its poses, in seconds: shifts the "
      "probe's speed against the change from image to image. Says so where the sweep does not "
      "tell (a steady hand, a short sweep). Needs frame times.");
  auto options = std::make_shared<LagOptions>();
  command->add_option("us", options->path, "tracked ultrasound: pre-scan NRRD or IGSIO sequence")
      ->required();
  options->ultrasound.add_to(*command);
  command->add_flag("--json", options->json, "print JSON, for programs");
  command->callback([options, &run] { run = [options] { return run_lag(*options); }; });
}

}  // namespace usct::tools
