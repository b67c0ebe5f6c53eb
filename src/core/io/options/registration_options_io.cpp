#include "us_ct_registration/io/options/registration_options_io.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "io/options/registration_options_fields.h"
#include "io/yaml_keys.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace io {
namespace {

constexpr const char* kUnset = "none";
constexpr const char* kInfinite = ".inf";

template <typename T>
constexpr bool is_single = std::is_arithmetic_v<T> || std::is_enum_v<T>;

template <typename T, typename = void>
struct Validates : std::false_type {};
template <typename T>
struct Validates<T, std::void_t<decltype(std::declval<const T&>().validate(std::string()))>>
    : std::true_type {};

/// Runs `action`, which names the fields of what is at `path`; errors name their whole path.
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

/// A value in a file: where it stands, and whether all its keys must be there (or only those that
/// change what is known already).
struct Place {
  const YAML::Node& node;
  const std::string& source;
  std::string path;
  bool whole;

  std::string text() const { return yaml_scalar(node, source, path); }
  bool is_unset() const { return node.IsScalar() && node.Scalar() == kUnset; }
};

void read(const Place& place, double& value) {
  const std::string text = place.text();
  value = text == kInfinite ? std::numeric_limits<double>::infinity()
                            : parse_double(text, place.source, place.path);
}

void read(const Place& place, int& value) {
  value = parse_int(place.text(), place.source, place.path);
}

void read(const Place& place, std::uint32_t& value) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  const std::string text = place.text();
  const double number = parse_double(text, place.source, place.path);
  if (!(number >= 0.0 && number <= kMost && number == std::floor(number)))
    throw InputError(place.source, "'" + place.path + "' is " + in_quotes(text) +
                                       ", must be a whole number within [0, 4294967295]");
  value = static_cast<std::uint32_t>(number);
}

void read(const Place& place, bool& value) {
  const std::string text = place.text();
  if (text != "true" && text != "false")
    throw InputError(place.source,
                     "'" + place.path + "' is " + in_quotes(text) + ", must be true or false");
  value = text == "true";
}

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
  } catch (const InputError& error) {  // "<whatever it calls itself> is 'x', must be one of ..."
    const std::string& violation = error.violation();
    const std::size_t begin = std::min(violation.find("is '"), violation.size());
    throw InputError(place.source, "'" + place.path + "' " + violation.substr(begin));
  }
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
    throw InputError(keys_.source(),
                     "key '" + keys_.path_of(key) +
                         "' is missing; only a file with 'preset: NAME' may leave keys out");
  }

  YamlKeys& keys_;
  bool whole_;
};

template <typename T>
void read_struct(YamlKeys& keys, const std::string& path, bool whole, T& value) {
  Reader fields(keys, whole);
  describe(fields, value);
  keys.refuse_unknown();
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

std::string path_of_entry(const std::string& path, std::size_t index) {
  return path + "[" + std::to_string(index) + "]";
}

/// Changes entries of a list, by their numbers.
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

std::string text_of(double value) {
  return std::isinf(value) && value > 0.0 ? kInfinite : format_double(value);
}
std::string text_of(int value) { return std::to_string(value); }
std::string text_of(std::uint32_t value) { return std::to_string(value); }
std::string text_of(bool value) { return value ? "true" : "false"; }
template <typename Enum, typename = std::enable_if_t<std::is_enum_v<Enum>>>
std::string text_of(Enum value) {
  return word_of(value);
}

/// Writes YAML, two blanks per level.
class Writer {
 public:
  Writer(std::string& text, int level) : text_(text), level_(level) {}

  template <typename T>
  void operator()(const std::string& key, T& value) {
    if constexpr (is_single<T>) {
      line(key, text_of(value));
    } else {
      line(key, "");
      Writer below(text_, level_ + 1);
      describe(below, value);
    }
  }
  template <typename T>
  void operator()(const std::string& key, std::optional<T>& value) {
    if (value)
      (*this)(key, *value);
    else
      line(key, kUnset);
  }
  template <typename T>
  void operator()(const std::string& key, std::vector<T>& values) {
    line(key, values.empty() ? "[]" : "");
    for (T& value : values) {
      const std::size_t begin = text_.size();
      Writer below(text_, level_ + 2);
      describe(below, value);
      text_[begin + indent() + 2] = '-';
    }
  }
  void degrees(const std::string& key, double& value_rad, double /*most_deg*/) {
    line(key, text_of(usct::degrees(value_rad)));
  }

 private:
  std::size_t indent() const { return 2 * static_cast<std::size_t>(level_); }
  void line(const std::string& key, const std::string& value) {
    text_.append(indent(), ' ');
    text_ += key + (value.empty() ? ":" : ": ") + value + "\n";
  }

  std::string& text_;
  int level_;
};

/// Lists values by the paths of their keys.
class Lister {
 public:
  Lister(std::map<std::string, std::string>& list, std::string prefix)
      : list_(list), prefix_(std::move(prefix)) {}

  template <typename T>
  void operator()(const std::string& key, T& value) {
    if constexpr (is_single<T>) {
      list_[prefix_ + key] = text_of(value);
    } else {
      Lister below(list_, prefix_ + key + ".");
      describe(below, value);
    }
  }
  template <typename T>
  void operator()(const std::string& key, std::optional<T>& value) {
    if (value)
      (*this)(key, *value);
    else
      list_[prefix_ + key] = kUnset;
  }
  template <typename T>
  void operator()(const std::string& key, std::vector<T>& values) {
    for (std::size_t i = 0; i < values.size(); ++i) (*this)(path_of_entry(key, i), values[i]);
  }
  void degrees(const std::string& key, double& value_rad, double /*most_deg*/) {
    list_[prefix_ + key] = text_of(usct::degrees(value_rad));
  }

 private:
  std::map<std::string, std::string>& list_;
  std::string prefix_;
};

RegistrationOptions read_root(const YAML::Node& root, const std::string& source) {
  YamlKeys keys(root, source);
  const bool derived = keys.has("preset");
  RegistrationOptions options;
  if (derived) {
    const std::string name = keys.text("preset");
    with_path(source, "preset", [&] { options = preset(name); });
  }
  read_struct(keys, "", !derived, options);
  return options;
}

}  // namespace
}  // namespace io

RegistrationOptions read_registration_options(const std::filesystem::path& path) {
  return io::read_root(io::read_yaml(path), path.string());
}

RegistrationOptions parse_registration_options(const std::string& yaml, const std::string& source) {
  return io::read_root(io::parse_yaml(yaml, source), source);
}

std::string registration_options_yaml(const RegistrationOptions& options) {
  RegistrationOptions copy = options;  // descriptions serve reading too
  std::string text;
  io::Writer fields(text, 0);
  io::describe(fields, copy);
  return text;
}

std::map<std::string, std::string> registration_options_text(const RegistrationOptions& options) {
  RegistrationOptions copy = options;
  std::map<std::string, std::string> list;
  io::Lister fields(list, "");
  io::describe(fields, copy);
  return list;
}

}  // namespace usct
