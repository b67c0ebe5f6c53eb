#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

/// Numbers, matrices and objects of JSON files, read strictly.
namespace usct::io {

using Json = nlohmann::ordered_json;

/// Parses a file's JSON. Throws InputError, naming `source`, for a key that an object has twice, of
/// which the library would keep the last, and for more levels than any of our files has: thousands,
/// in a damaged file, would exhaust the stack. Throws the library's exception if it is not JSON.
template <typename AnyJson, typename Input>
AnyJson parse_json(Input&& input, const std::string& source) {
  constexpr int kDeepest = 8;
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto check = [&](int depth, typename AnyJson::parse_event_t event, const AnyJson& value) {
    using Event = typename AnyJson::parse_event_t;
    if (depth > kDeepest) throw InputError(source, "is damaged: it is nested too deeply");
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(value.template get<std::string>()).second)
      throw InputError(source,
                       "key " + in_quotes(value.template get<std::string>()) + " is given twice");
    return true;
  };
  return AnyJson::parse(std::forward<Input>(input), check);
}

template <int N>
using RowMajor = Eigen::Matrix<double, N, N, Eigen::RowMajor>;

/// Numbers row by row.
template <int N>
Json matrix_json(const RowMajor<N>& matrix) {
  return std::vector<double>(matrix.data(), matrix.data() + matrix.size());
}

/// Unknown numbers are null.
inline Json number_json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

inline Json pose_json(const Eigen::Isometry3d& T) { return matrix_json<4>(T.matrix()); }

/// The members of one JSON object, which must be those in `names`. Errors are InputErrors that name
/// the source and the key.
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

}  // namespace usct::io
