#include "evaluation/study_run_json.h"

namespace usct {
namespace {

using io::Json;
using io::Members;
using io::number_json;
using io::pose_json;

Json errors_json(const TargetErrors& errors) {
  return {{"mean", errors.mean_mm},
          {"rms", errors.rms_mm},
          {"median", errors.median_mm},
          {"max", errors.max_mm}};
}

TargetErrors errors_from(const Json& json, const std::string& source) {
  const Members members(json, source, {"mean", "rms", "median", "max"});
  return {members.number_or_nan("mean"),
          members.number_or_nan("rms"),
          members.number_or_nan("median"),
          members.number_or_nan("max"),
          {}};
}

Json rigid_json(const PoseErrors* errors) {
  return errors == nullptr ? Json(nullptr) : errors_json(errors->rigid);
}

Json physical_json(const PoseErrors* errors) {
  return errors == nullptr ? Json(nullptr) : errors_json(errors->physical);
}

std::optional<PoseErrors> pose_errors_from(const Json& rigid, const Json& physical,
                                           const std::string& source) {
  if (rigid.is_null() != physical.is_null())
    throw InputError(source,
                     "errors against truth and physical errors must be there both, or null");
  if (rigid.is_null()) return std::nullopt;
  return PoseErrors{errors_from(rigid, source), errors_from(physical, source)};
}

template <typename T>
const T* pointer_to(const std::optional<T>& value) {
  return value ? &*value : nullptr;
}

Json candidates_json(const StudyRun& run) {
  Json list = Json::array();
  for (std::size_t i = 0; i < run.result.candidates.size(); ++i) {
    const RegistrationCandidate& candidate = run.result.candidates[i];
    const PoseErrors* errors = run.candidates.empty() ? nullptr : &run.candidates[i];
    list.push_back({{"T_us_ct", pose_json(candidate.T_us_ct)},
                    {"similarity", number_json(candidate.similarity)},
                    {"overlap", number_json(candidate.overlap)},
                    {"tre_mm", rigid_json(errors)},
                    {"physical_mm", physical_json(errors)}});
  }
  return list;
}

void read_candidates(const Json& list, const std::string& source, StudyRun& run) {
  if (!list.is_array()) throw InputError(source, "'candidates' must be an array");
  for (const Json& entry : list) {
    const Members members(entry, source,
                          {"T_us_ct", "similarity", "overlap", "tre_mm", "physical_mm"});
    run.result.candidates.push_back({members.pose("T_us_ct"), members.number_or_nan("similarity"),
                                     members.number_or_nan("overlap")});
    if (const auto errors =
            pose_errors_from(members.at("tre_mm"), members.at("physical_mm"), source))
      run.candidates.push_back(*errors);
  }
  if (!run.candidates.empty() && run.candidates.size() != run.result.candidates.size())
    throw InputError(source, "'candidates' must have errors all, or none");
}

Json expected_json(const StudyRun& run) {
  if (!run.expected) return nullptr;
  return {{"rms", run.expected->rms_mm}, {"max", run.expected->max_mm}};
}

std::optional<ExpectedTargetErrors> expected_from(const Json& json, const std::string& source) {
  if (json.is_null()) return std::nullopt;
  const Members members(json, source, {"rms", "max"});
  return ExpectedTargetErrors{members.number_or_nan("rms"), members.number_or_nan("max")};
}

}  // namespace

Json run_json(const StudyRun& run) {
  return {{"method", run.method},
          {"case", run.case_name},
          {"group", run.group},
          {"ct_case", run.ct_case_name},
          {"kind", kind_name(run.trial.kind)},
          {"seed", run.trial.study_seed},
          {"start", run.trial.index},
          {"displacement_mm", run.trial.displacement_mm},
          {"T_us_ct_initial", pose_json(run.trial.T_us_ct_initial)},
          {"status", status_name(run.result.status)},
          {"message", run.result.message},
          {"T_us_ct", run.accepted() ? pose_json(*run.result.T_us_ct) : Json(nullptr)},
          {"before_tre_mm", rigid_json(pointer_to(run.before))},
          {"before_physical_mm", physical_json(pointer_to(run.before))},
          {"tre_mm", rigid_json(pointer_to(run.after))},
          {"physical_mm", physical_json(pointer_to(run.after))},
          {"expected_tre_mm", expected_json(run)},
          {"similarity", number_json(run.result.similarity)},
          {"overlap", number_json(run.result.overlap)},
          {"candidates", candidates_json(run)},
          {"evaluations", run.result.evaluations},
          {"measures", by_name(run.result.measures)},
          {"seconds", run.result.seconds},
          {"peak_memory_mib", run.peak_memory_mib ? Json(*run.peak_memory_mib) : Json(nullptr)}};
}

StudyRun run_from_json(const Json& json, const StudyPlan& plan, std::size_t index,
                       const std::string& source) {
  const Members members(json, source,
                        {"method",
                         "case",
                         "group",
                         "ct_case",
                         "kind",
                         "seed",
                         "start",
                         "displacement_mm",
                         "T_us_ct_initial",
                         "status",
                         "message",
                         "T_us_ct",
                         "before_tre_mm",
                         "before_physical_mm",
                         "tre_mm",
                         "physical_mm",
                         "expected_tre_mm",
                         "similarity",
                         "overlap",
                         "candidates",
                         "evaluations",
                         "measures",
                         "seconds",
                         "peak_memory_mib"});
  const PlannedRun& planned = plan.runs[index];
  StudyRun run;
  run.trial = planned.trial;
  run.method = plan.study.methods[planned.method].name;
  run.case_name = plan.cases[planned.trial.us_case].name;
  run.group = plan.cases[planned.trial.us_case].group();
  run.ct_case_name = plan.cases[planned.trial.ct_case].name;
  run.result.status = parse_status(members.text("status"), source);
  run.result.message = members.text("message");
  if (!members.is_null("T_us_ct")) run.result.T_us_ct = members.pose("T_us_ct");
  run.before =
      pose_errors_from(members.at("before_tre_mm"), members.at("before_physical_mm"), source);
  run.after = pose_errors_from(members.at("tre_mm"), members.at("physical_mm"), source);
  run.expected = expected_from(members.at("expected_tre_mm"), source);
  run.result.similarity = members.number_or_nan("similarity");
  run.result.overlap = members.number_or_nan("overlap");
  read_candidates(members.at("candidates"), source, run);
  run.result.evaluations = members.count("evaluations");
  run.result.measures = measures_from(members.map<double>("measures"), source);
  run.result.seconds = members.map<double>("seconds");
  if (!members.is_null("peak_memory_mib"))
    run.peak_memory_mib = members.number_or_nan("peak_memory_mib");
  return run;
}

}  // namespace usct
