#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "io/options/options_text.h"
#include "io/options/registration_options_fields.h"
#include "io/yaml_keys.h"

/// Reads the fields that registration_options_fields.h describes from YAML.
namespace usct::io {

template <typename T, typename = void>
struct Validates : std::false_type {};
template <typename T>
struct Validates<T, std::void_t<decltype(std::declval<const T&>().validate(std::string()))>>
    : std::true_type {};

/// Runs `action`, which names the fields of the node at `path`; errors then name their whole path.
template <typename Action>
void with_path(const std::string& source, const std::string& path, const Action& action) {
  try {
    action();
  } catch (const InputError& error) {
    const std::string& violation = error.violation();
    if (path.empty()) throw;
    if (violation.empty() || violation[0] != '\'')
      throw InputError(source, "'" + path + "' " + violation);
    throw InputError(source, "'" + path + "." + violation.substr(1));
  }
}

/// A value in a file: its position, and whether all its keys must be there (or only those that
/// change a known value).
struct Place {
  const YAML::Node& node;
  const std::string& source;
  std::string path;
  bool whole;

  std::string text() const { return yaml_scalar(node, source, path); }
  bool is_unset() const { return node.IsScalar() && node.Scalar() == kUnset; }
};

inline void read(const Place& place, double& value) {
  const std::string text = place.text();
  value = text == kInfinite ? std::numeric_limits<double>::infinity()
                            : parse_double(text, place.source, place.path);
}

inline void read(const Place& place, int& value) {
  value = parse_int(place.text(), place.source, place.path);
}

inline void read(const Place& place, std::uint32_t& value) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  const std::string text = place.text();
  const double number = parse_double(text, place.source, place.path);
  if (!(number >= 0.0 && number <= kMost && number == std::floor(number)))
    throw InputError(place.source, "'" + place.path + "' is " + in_quotes(text) +
                                       ", must be a whole number within [0, 4294967295]");
  value = static_cast<std::uint32_t>(number);
}

inline void read(const Place& place, bool& value) {
  const std::string text = place.text();
  if (text != "true" && text != "false")
    throw InputError(place.source,
                     "'" + place.path + "' is " + in_quotes(text) + ", must be true or false");
  value = text == "true";
}

inline void read(const Place& place, SimilarityOptions& value);
template <typename T>
void read(const Place& place, T& value);
template <typename T>
void read(const Place& place, std::optional<T>& value);
template <typename T>
void read(const Place& place, std::vector<T>& values);

template <typename Enum>
void read_word(const Place& place, Enum& value) {
  const std::string text = place.text();
  try {
    parse_word(text, place.source, value);
  } catch (const InputError& error) {  // "<own name> is 'x', must be one of ..."
    const std::string& violation = error.violation();
    const std::size_t begin = std::min(violation.find("is '"), violation.size());
    throw InputError(place.source, "'" + place.path + "' " + violation.substr(begin));
  }
}

[[noreturn]] inline void throw_missing(const YamlKeys& keys, const std::string& key) {
  throw InputError(keys.source(),
                   "key '" + keys.path_of(key) +
                       "' is missing; only a file with 'preset: NAME' may leave keys out");
}

class Reader {
 public:
  Reader(YamlKeys& keys, bool whole) : keys_(keys), whole_(whole) {}

  template <typename T>
  void operator()(const std::string& key, T& value) {
    if (is_there(key)) read({keys_.node(key), keys_.source(), keys_.path_of(key), whole_}, value);
  }
  void degrees(const std::string& key, double& value_rad, double most_deg) {
    if (!is_there(key)) return;
    const double value_deg = keys_.number(key);
    if (!(value_deg >= 0.0 && value_deg <= most_deg))
      throw InputError(keys_.source(), "'" + keys_.path_of(key) + "' is " +
                                           format_double(value_deg) + ", must be within [0, " +
                                           format_double(most_deg) + "]");
    value_rad = radians(value_deg);
  }

 private:
  bool is_there(const std::string& key) const {
    if (keys_.has(key) || !whole_) return keys_.has(key);
    throw_missing(keys_, key);
  }

  YamlKeys& keys_;
  bool whole_;
};

template <typename T>
void read_struct(YamlKeys& keys, const std::string& path, bool whole, T& value,
                 const std::string& hint = "") {
  Reader fields(keys, whole);
  describe(fields, value);
  keys.refuse_unknown(hint);
  if constexpr (Validates<T>::value)
    with_path(keys.source(), path, [&] { value.validate(keys.source()); });
}

template <typename T>
void read(const Place& place, T& value) {
  if constexpr (std::is_enum_v<T>) {
    read_word(place, value);
  } else {
    YamlKeys keys(place.node, place.source, place.path);
    read_struct(keys, place.path, place.whole, value);
  }
}

/// Keys of another metric do not carry over: if the kind changes, all keys must be there.
inline void read(const Place& place, SimilarityOptions& value) {
  YamlKeys keys(place.node, place.source, place.path);
  bool whole = place.whole;
  if (keys.has("kind")) {
    with_path(place.source, keys.path_of("kind"), [&] {
      const SimilarityOptions named = similarity_named(keys.text("kind"), place.source);
      if (named.index() == value.index()) return;
      value = named;
      whole = true;
    });
  } else if (whole) {
    throw_missing(keys, "kind");
  }
  std::visit(
      [&](auto& metric) {
        const std::string hint = std::string(", ") + metric.kName + " has no such option";
        read_struct(keys, place.path, whole, metric, hint);
      },
      value);
}

template <typename T>
void read(const Place& place, std::optional<T>& value) {
  if (place.is_unset()) {
    value.reset();
    return;
  }
  const bool whole = place.whole || !value;
  if (!value) value.emplace();
  read({place.node, place.source, place.path, whole}, *value);
}

/// Changes entries of a list by their indices.
template <typename T>
void change(const Place& place, std::vector<T>& values) {
  YamlKeys entries(place.node, place.source, place.path);
  std::vector<std::optional<T>> changed(values.begin(), values.end());
  for (const std::string& key : entries.all()) {
    const int index = parse_int(key, place.source, place.path);
    if (index < 0 || index >= static_cast<int>(values.size()))
      throw InputError(place.source, "'" + place.path + "' has no entry " + in_quotes(key) +
                                         " to change, must be within [0, " +
                                         std::to_string(values.size() - 1) + "]");
    const auto i = static_cast<std::size_t>(index);
    read({entries.node(key), place.source, path_of_entry(place.path, i), false}, changed[i]);
  }
  values.clear();
  for (std::optional<T>& value : changed)
    if (value) values.push_back(std::move(*value));
}

template <typename T>
void read(const Place& place, std::vector<T>& values) {
  if (place.node.IsMap() && !place.whole) return change(place, values);
  if (!place.node.IsSequence())
    throw InputError(place.source, "'" + place.path + "' must be a list");
  values.assign(place.node.size(), T{});
  for (std::size_t i = 0; i < values.size(); ++i)
    read({place.node[i], place.source, path_of_entry(place.path, i), true}, values[i]);
}

}  // namespace usct::io
