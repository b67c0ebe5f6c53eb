#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::tools {
namespace {

struct EvaluateOptions {
  std::string result;
  std::string truth;
  std::string targets;
  bool candidates = false;
  bool json = false;
};

struct Evaluation {
  RegistrationResult result;
  std::size_t targets = 0;
  std::optional<TargetErrors> errors;            // set if the result is registered
  std::optional<ExpectedTargetErrors> expected;  // set if it has a covariance
  std::vector<TargetErrors> candidates;          // filled if requested
};

Evaluation evaluate(const EvaluateOptions& options) {
  Evaluation evaluation;
  evaluation.result = read_result(options.result);
  const RegistrationResult& result = evaluation.result;
  const Eigen::Isometry3d T_us_ct_true = read_T_us_ct(options.truth);
  const std::vector<Eigen::Vector3d> targets_us_mm = read_points_mm(options.targets);
  evaluation.targets = targets_us_mm.size();
  if (result.T_us_ct) {
    evaluation.errors = evaluate_targets(*result.T_us_ct, T_us_ct_true, targets_us_mm);
    if (result.covariance)
      evaluation.expected = expected_tre_mm(*result.covariance, targets_us_mm, options.result);
  }
  if (options.candidates)
    for (const RegistrationCandidate& candidate : result.candidates)
      evaluation.candidates.push_back(
          evaluate_targets(candidate.T_us_ct, T_us_ct_true, targets_us_mm));
  return evaluation;
}

void print_errors(const TargetErrors& errors) {
  std::printf("mean %.3f, RMS %.3f, median %.3f, max %.3f", errors.mean_mm, errors.rms_mm,
              errors.median_mm, errors.max_mm);
}

void print_text(const Evaluation& evaluation) {
  std::printf("targets: %zu\n", evaluation.targets);
  if (evaluation.errors) {
    std::printf("TRE, mm: ");
    print_errors(*evaluation.errors);
    std::printf("\n");
  }
  if (evaluation.expected)
    std::printf("expected by the result, mm: RMS %.3f, max %.3f\n", evaluation.expected->rms_mm,
                evaluation.expected->max_mm);
  for (std::size_t i = 0; i < evaluation.candidates.size(); ++i) {
    std::printf("candidate %zu, similarity %.4f, overlap %.2f, TRE, mm: ", i,
                evaluation.result.candidates[i].similarity,
                evaluation.result.candidates[i].overlap);
    print_errors(evaluation.candidates[i]);
    std::printf("\n");
  }
}

nlohmann::ordered_json as_json(const TargetErrors& errors) {
  return {{"mean", errors.mean_mm},
          {"rms", errors.rms_mm},
          {"median", errors.median_mm},
          {"max", errors.max_mm}};
}

void print_json(const Evaluation& evaluation, bool with_candidates) {
  nlohmann::ordered_json json;
  json["status"] = status_name(evaluation.result.status);
  json["message"] = evaluation.result.message;
  json["targets"] = evaluation.targets;
  json["tre_mm"] = nullptr;
  json["expected_tre_mm"] = nullptr;
  if (evaluation.errors) {
    json["tre_mm"] = as_json(*evaluation.errors);
    json["tre_mm"]["per_target"] = evaluation.errors->per_target_mm;
  }
  if (evaluation.expected)
    json["expected_tre_mm"] = {{"rms", evaluation.expected->rms_mm},
                               {"max", evaluation.expected->max_mm}};
  if (with_candidates) {
    json["candidates"] = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < evaluation.candidates.size(); ++i)
      json["candidates"].push_back({{"similarity", evaluation.result.candidates[i].similarity},
                                    {"overlap", evaluation.result.candidates[i].overlap},
                                    {"tre_mm", as_json(evaluation.candidates[i])}});
  }
  using Handler = nlohmann::ordered_json::error_handler_t;
  std::printf("%s\n", json.dump(2, ' ', false, Handler::replace).c_str());
}

int run_evaluate(const EvaluateOptions& options) {
  const Evaluation evaluation = evaluate(options);
  if (options.json)
    print_json(evaluation, options.candidates);
  else
    print_text(evaluation);
  if (evaluation.errors) return kDone;
  std::fprintf(stderr, "usct: %s: is not registered, so has no TRE: %s (%s)\n",
               options.result.c_str(), status_name(evaluation.result.status),
               evaluation.result.message.c_str());
  return kRefused;
}

}  // namespace

void add_evaluate_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "evaluate",
      "Target registration error of a result where the truth is known: the distance, in mm, of "
      "each target from where the result puts it. Beside it, the error that the result itself "
      "expects, from its covariance. Exit status 3 if the result is not registered.");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("--result", options->result, "JSON of a registration")->required();
  command
      ->add_option("--truth", options->truth,
                   "ITK transform of the true pose, from US to CT points, mm, LPS")
      ->required();
  command->add_option("--targets", options->targets, "CSV x,y,z in the US frame, mm")->required();
  command->add_flag("--candidates", options->candidates,
                    "errors of all the optima that the result lists, too");
  command->add_flag("--json", options->json,
                    "print JSON, for programs; with the error of each target");
  command->callback([options, &run] { run = [options] { return run_evaluate(*options); }; });
}

}  // namespace usct::tools
