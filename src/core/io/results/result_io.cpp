#include "us_ct_registration/io/results/result_io.h"

#include "io/bytes.h"
#include "io/json_members.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

using io::Json;
using io::matrix_json;
using io::Members;
using io::number_json;
using io::pose_json;

/// The overlap is a fraction, or not known.
void check_overlap(double overlap, const std::string& source) {
  if (overlap < 0.0 || overlap > 1.0)
    throw InputError(source, "'overlap' is " + format_double(overlap) + ", must be in [0, 1]");
}

void check(const RegistrationResult& result, const std::string& source) {
  const bool registered = result.status == RegistrationStatus::kRegistered;
  if (registered != result.T_us_ct.has_value())
    throw InputError(source, std::string("status is '") + status_name(result.status) +
                                 "', 'T_us_ct' must be " + (registered ? "a transform" : "null"));
  if (result.T_us_ct) require_rotation(result.T_us_ct->linear(), source, "T_us_ct");
  if (result.covariance) require_covariance(*result.covariance, source);
  check_overlap(result.overlap, source);
  for (std::size_t i = 0; i < result.candidates.size(); ++i)
    check_overlap(result.candidates[i].overlap, source + ": candidate " + std::to_string(i));
}

Json candidates_json(const std::vector<RegistrationCandidate>& candidates) {
  Json list = Json::array();
  for (const RegistrationCandidate& candidate : candidates)
    list.push_back({{"T_us_ct", pose_json(candidate.T_us_ct)},
                    {"similarity", number_json(candidate.similarity)},
                    {"overlap", number_json(candidate.overlap)}});
  return list;
}

std::vector<RegistrationCandidate> read_candidates(const Json& list, const std::string& source) {
  if (!list.is_array()) throw InputError(source, "'candidates' must be an array");
  std::vector<RegistrationCandidate> candidates;
  for (const Json& entry : list) {
    const Members members(entry, source + ": candidate " + std::to_string(candidates.size()),
                          {"T_us_ct", "similarity", "overlap"});
    candidates.push_back({members.pose("T_us_ct"), members.number_or_nan("similarity"),
                          members.number_or_nan("overlap")});
  }
  return candidates;
}

Json read_json(const std::filesystem::path& path) {
  const io::Bytes bytes = io::read_text_bytes(path);
  try {
    return io::parse_json<Json>(bytes, path.string());
  } catch (const Json::exception& error) {
    throw InputError(path.string(), std::string("is not valid JSON: ") + error.what());
  }
}

}  // namespace

RegistrationResult read_result(const std::filesystem::path& path) {
  const std::string source = path.string();
  const Json json = read_json(path);
  if (json.is_object() && !json.contains("status"))
    throw InputError(source, "is no result of a registration: key 'status' is missing");
  const Members members(json, source,
                        {"status", "message", "T_us_ct", "similarity", "overlap", "covariance",
                         "candidates", "measures", "evaluations", "seconds", "options", "version"});
  RegistrationResult result;
  result.status = parse_status(members.text("status"), source);
  result.message = members.text("message");
  if (!members.is_null("T_us_ct")) result.T_us_ct = members.pose("T_us_ct");
  result.similarity = members.number_or_nan("similarity");
  result.overlap = members.number_or_nan("overlap");
  if (!members.is_null("covariance")) result.covariance = members.matrix<6>("covariance");
  result.candidates = read_candidates(members.at("candidates"), source);
  result.measures = measures_from(members.map<double>("measures"), source);
  result.evaluations = members.count("evaluations");
  result.seconds = members.map<double>("seconds");
  result.options = members.map<std::string>("options");
  result.version = members.text("version");
  check(result, source);
  return result;
}

std::string result_json(const RegistrationResult& result, const std::string& source) {
  check(result, source);
  Json json;
  json["status"] = status_name(result.status);
  json["message"] = result.message;
  json["T_us_ct"] = result.T_us_ct ? pose_json(*result.T_us_ct) : Json(nullptr);
  json["similarity"] = number_json(result.similarity);
  json["overlap"] = number_json(result.overlap);
  json["covariance"] = result.covariance ? matrix_json<6>(*result.covariance) : Json(nullptr);
  json["candidates"] = candidates_json(result.candidates);
  json["measures"] = by_name(result.measures);
  json["evaluations"] = result.evaluations;
  json["seconds"] = result.seconds;
  json["options"] = result.options;
  json["version"] = result.version;
  constexpr int kIndent = 2;
  // Text from outside (a file name in a message) need not be UTF-8, and must not prevent writing.
  return json.dump(kIndent, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_result(const RegistrationResult& result, const std::filesystem::path& path) {
  write_text(path, result_json(result, path.string()));
}

}  // namespace usct
