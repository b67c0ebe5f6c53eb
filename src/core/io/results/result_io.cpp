#include "us_ct_registration/io/results/result_io.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

using Json = nlohmann::ordered_json;

template <int N>
using RowMajor = Eigen::Matrix<double, N, N, Eigen::RowMajor>;

template <int N>
Json matrix_json(const RowMajor<N>& matrix) {
  return std::vector<double>(matrix.data(), matrix.data() + matrix.size());
}

Json number_json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json pose_json(const Eigen::Isometry3d& T) { return matrix_json<4>(T.matrix()); }

/// The members of one JSON object, which must be those in `names`.
class Members {
 public:
  Members(const Json& object, std::string source, std::initializer_list<const char*> names)
      : object_(object), source_(std::move(source)) {
    if (!object.is_object()) throw InputError(source_, "must be a JSON object");
    for (const char* name : names)
      if (!object.contains(name))
        throw InputError(source_, "key '" + std::string(name) + "' is missing");
    if (object.size() == names.size()) return;
    for (const auto& [key, value] : object.items())
      if (std::find(names.begin(), names.end(), key) == names.end())
        throw InputError(source_, "key " + in_quotes(key) + " is unknown");
  }

  const Json& at(const char* name) const { return object_.at(name); }
  bool is_null(const char* name) const { return at(name).is_null(); }

  std::string text(const char* name) const {
    if (!at(name).is_string()) fail(name, "must be text");
    return at(name).get<std::string>();
  }
  double number_or_nan(const char* name) const {
    if (is_null(name)) return std::numeric_limits<double>::quiet_NaN();
    if (!at(name).is_number()) fail(name, "must be a number or null");
    return at(name).get<double>();
  }
  int count(const char* name) const {
    if (!at(name).is_number_integer() || at(name) < 0 || at(name) > std::numeric_limits<int>::max())
      fail(name, "must be a whole number >= 0");
    return at(name).get<int>();
  }
  template <int N>
  RowMajor<N> matrix(const char* name) const {
    constexpr std::size_t kCount = std::size_t{N} * N;
    const Json& values = at(name);
    if (!values.is_array() || values.size() != kCount)
      fail(name, "must be " + std::to_string(kCount) + " numbers");
    RowMajor<N> matrix;
    for (std::size_t i = 0; i < kCount; ++i) {
      const Json& value = values[i];
      if (!value.is_number()) fail(name, "must be " + std::to_string(kCount) + " numbers");
      matrix.data()[i] = value.get<double>();
    }
    return matrix;
  }
  Eigen::Isometry3d pose(const char* name) const {
    Eigen::Isometry3d T;
    T.matrix() = matrix<4>(name);
    if (T.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) fail(name, "last row must be 0 0 0 1");
    require_rotation(T.linear(), source_, name);
    return T;
  }
  /// A JSON object whose values are of one type.
  template <typename T>
  std::map<std::string, T> map(const char* name) const {
    try {
      return at(name).get<std::map<std::string, T>>();
    } catch (const Json::exception&) {
      fail(name, "is not an object with values of the right type");
    }
  }

 private:
  [[noreturn]] void fail(const std::string& name, const std::string& violation) const {
    throw InputError(source_, "'" + name + "' " + violation);
  }

  const Json& object_;
  std::string source_;
};

void check(const RegistrationResult& result, const std::string& source) {
  const bool registered = result.status == RegistrationStatus::kRegistered;
  if (registered != result.T_us_ct.has_value())
    throw InputError(source, std::string("status is '") + status_name(result.status) +
                                 "', 'T_us_ct' must be " + (registered ? "a transform" : "null"));
  if (result.T_us_ct) require_rotation(result.T_us_ct->linear(), source, "T_us_ct");
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

Json parse_json(const std::filesystem::path& path) {
  const io::Bytes bytes = io::read_bytes(path);
  try {
    return Json::parse(bytes);
  } catch (const Json::exception& error) {
    throw InputError(path.string(), std::string("is not valid JSON: ") + error.what());
  }
}

}  // namespace

RegistrationResult read_result(const std::filesystem::path& path) {
  const std::string source = path.string();
  const Json json = parse_json(path);
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
  io::write_text(path, result_json(result, path.string()));
}

}  // namespace usct
