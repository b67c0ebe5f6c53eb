#pragma once

#include <cmath>
#include <map>

#include "io/options/options_text.h"
#include "io/options/registration_options_fields.h"

/// Writes the fields that registration_options_fields.h describes as YAML, and lists them.
namespace usct::io {

inline std::string text_of(double value) {
  return std::isinf(value) && value > 0.0 ? kInfinite : format_double(value);
}
inline std::string text_of(int value) { return std::to_string(value); }
inline std::string text_of(std::uint32_t value) { return std::to_string(value); }
inline std::string text_of(bool value) { return value ? "true" : "false"; }
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
  void operator()(const std::string& key, SimilarityOptions& value) {
    line(key, "");
    Writer below(text_, level_ + 1);
    below.line("kind", similarity_name(value));
    std::visit([&](auto& metric) { describe(below, metric); }, value);
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
  void operator()(const std::string& key, SimilarityOptions& value) {
    list_[prefix_ + key + ".kind"] = similarity_name(value);
    Lister below(list_, prefix_ + key + ".");
    std::visit([&](auto& metric) { describe(below, metric); }, value);
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

}  // namespace usct::io
