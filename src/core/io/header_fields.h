#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace usct::io {

/// The `field <separator> value` lines of a text header. A field that is given twice, or missing
/// where it is required, is an InputError that names the file and the field.
class HeaderFields {
 public:
  explicit HeaderFields(std::string source, std::map<std::string, std::string> values = {})
      : source_(std::move(source)), values_(std::move(values)) {}

  void add(std::string_view field, std::string_view value);

  const std::string& source() const { return source_; }
  std::optional<std::string> find(const std::string& field) const;
  const std::string& require(const std::string& field) const;

  /// Throw InputError unless the field holds exactly `count` (whole, or finite) numbers.
  std::vector<int> require_ints(const std::string& field, std::size_t count) const;
  std::vector<double> require_doubles(const std::string& field, std::size_t count) const;

  /// Throws InputError: "'field' is value, must be constraint".
  [[noreturn]] void refuse(const std::string& field, const std::string& constraint) const;

 private:
  void check_count(const std::string& field, std::size_t found, std::size_t count) const;

  std::string source_;
  std::map<std::string, std::string> values_;
};

}  // namespace usct::io
