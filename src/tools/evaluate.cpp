#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::tools {
namespace {

struct EvaluateOptions {
  std::string result;
  std::string truth;
  std::string targets;
  std::string targets_ct;
  bool candidates = false;
  bool json = false;
};

struct Errors {
  TargetErrors rigid;
  std::optional<TargetErrors> physical;  // set if the targets' positions in the CT are given
};

struct Evaluation {
  RegistrationResult result;
  std::size_t targets = 0;
  std::optional<Errors> errors;                  // set if the result is registered
  std::optional<ExpectedTargetErrors> expected;  // set if it has a covariance
  std::vector<Errors> candidates;                // filled if requested
};

/// The positions of the targets in the CT; empty if they are not given.
std::vector<Eigen::Vector3d> read_targets_ct_mm(const EvaluateOptions& options,
                                                std::size_t targets) {
  if (options.targets_ct.empty()) return {};
  std::vector<Eigen::Vector3d> points_mm = read_points_mm(options.targets_ct);
  require_same_count(options.targets_ct, points_mm.size(), "--targets", targets);
  return points_mm;
}

Evaluation evaluate(const EvaluateOptions& options) {
  Evaluation evaluation;
  evaluation.result = read_result(options.result);
  const RegistrationResult& result = evaluation.result;
  const Eigen::Isometry3d T_us_ct_true = read_T_us_ct(options.truth);
  const std::vector<Eigen::Vector3d> targets_us_mm = read_points_mm(options.targets);
  evaluation.targets = targets_us_mm.size();
  const std::vector<Eigen::Vector3d> targets_ct_mm =
      read_targets_ct_mm(options, targets_us_mm.size());
  const auto errors_of = [&](const Eigen::Isometry3d& T_us_ct) {
    Errors errors{evaluate_targets(T_us_ct, T_us_ct_true, targets_us_mm), {}};
    if (!targets_ct_mm.empty())
      errors.physical = evaluate_matched_targets(T_us_ct, targets_ct_mm, targets_us_mm);
    return errors;
  };
  if (result.T_us_ct) {
    evaluation.errors = errors_of(*result.T_us_ct);
    if (result.covariance)
      evaluation.expected = expected_tre_mm(*result.covariance, targets_us_mm, options.result);
  }
  if (options.candidates)
    for (const RegistrationCandidate& candidate : result.candidates)
      evaluation.candidates.push_back(errors_of(candidate.T_us_ct));
  return evaluation;
}

void print_errors(const std::string& name, const TargetErrors& errors) {
  std::printf("%s, mm: mean %.3f, RMS %.3f, median %.3f, max %.3f\n", name.c_str(), errors.mean_mm,
              errors.rms_mm, errors.median_mm, errors.max_mm);
}

void print_errors(const std::string& prefix, const Errors& errors) {
  print_errors(prefix + "TRE", errors.rigid);
  if (errors.physical) print_errors(prefix + "physical error", *errors.physical);
}

void print_text(const Evaluation& evaluation) {
  std::printf("targets: %zu\n", evaluation.targets);
  if (evaluation.errors) print_errors("", *evaluation.errors);
  if (evaluation.expected)
    std::printf("expected by the result, mm: RMS %.3f, max %.3f\n", evaluation.expected->rms_mm,
                evaluation.expected->max_mm);
  for (std::size_t i = 0; i < evaluation.candidates.size(); ++i) {
    const RegistrationCandidate& candidate = evaluation.result.candidates[i];
    print_errors(formatted("candidate %zu, similarity %.4f, overlap %.2f, ", i,
                           candidate.similarity, candidate.overlap),
                 evaluation.candidates[i]);
  }
}

using Json = nlohmann::ordered_json;

Json as_json(const TargetErrors& errors, bool with_targets) {
  Json json{{"mean", errors.mean_mm},
            {"rms", errors.rms_mm},
            {"median", errors.median_mm},
            {"max", errors.max_mm}};
  if (with_targets) json["per_target"] = errors.per_target_mm;
  return json;
}

/// Both errors of a pose, null if unknown.
void add_errors(Json& json, const Errors* errors, bool with_targets) {
  json["tre_mm"] = errors == nullptr ? Json(nullptr) : as_json(errors->rigid, with_targets);
  json["physical_mm"] = errors == nullptr || !errors->physical
                            ? Json(nullptr)
                            : as_json(*errors->physical, with_targets);
}

void print_json(const Evaluation& evaluation, bool with_candidates) {
  Json json;
  json["status"] = status_name(evaluation.result.status);
  json["message"] = evaluation.result.message;
  json["targets"] = evaluation.targets;
  add_errors(json, evaluation.errors ? &*evaluation.errors : nullptr, true);
  json["expected_tre_mm"] = nullptr;
  if (evaluation.expected)
    json["expected_tre_mm"] = {{"rms", evaluation.expected->rms_mm},
                               {"max", evaluation.expected->max_mm}};
  if (with_candidates) {
    json["candidates"] = Json::array();
    for (std::size_t i = 0; i < evaluation.candidates.size(); ++i) {
      Json candidate{{"similarity", evaluation.result.candidates[i].similarity},
                     {"overlap", evaluation.result.candidates[i].overlap}};
      add_errors(candidate, &evaluation.candidates[i], false);
      json["candidates"].push_back(std::move(candidate));
    }
  }
  std::printf("%s\n", json.dump(2, ' ', false, Json::error_handler_t::replace).c_str());
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
      "Target registration error (TRE) of a result where the true pose is known: the distance, in "
      "mm, of each target from where the result puts it. With --targets-ct also the physical "
      "error: the distance of the targets themselves, which includes what deformed between CT and "
      "ultrasound, where the true pose is a rigid fit. Beside both, the error that the result "
      "itself expects, from its covariance. Exit status 3 if the result is not registered.");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("--result", options->result, "JSON of a registration")->required();
  command
      ->add_option("--truth", options->truth,
                   "ITK transform of the true pose, from US to CT points, mm, LPS")
      ->required();
  command->add_option("--targets", options->targets, "CSV x,y,z in the US frame, mm")->required();
  command->add_option("--targets-ct", options->targets_ct,
                      "CSV x,y,z of the same targets in the CT, in the same order, mm, LPS: adds "
                      "the physical error");
  command->add_flag("--candidates", options->candidates,
                    "errors of all the optima that the result lists, too");
  command->add_flag("--json", options->json,
                    "print JSON, for programs; with the error of each target");
  command->callback([options, &run] { run = [options] { return run_evaluate(*options); }; });
}

}  // namespace usct::tools
