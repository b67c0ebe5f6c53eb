#include "io/header_fields.h"

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {

void HeaderFields::add(std::string_view field, std::string_view value) {
  const bool is_new = values_.emplace(trimmed(field), trimmed(value)).second;
  if (!is_new) throw InputError(source_, "field " + in_quotes(field) + " is there twice");
}

std::optional<std::string> HeaderFields::find(const std::string& field) const {
  const auto found = values_.find(field);
  if (found == values_.end()) return std::nullopt;
  return found->second;
}

const std::string& HeaderFields::require(const std::string& field) const {
  const auto found = values_.find(field);
  if (found == values_.end())
    throw InputError(source_, "field '" + field + "' is missing; no default takes its place");
  return found->second;
}

std::vector<int> HeaderFields::require_ints(const std::string& field, std::size_t count) const {
  std::vector<int> numbers;
  for (const std::string_view word : words(require(field)))
    numbers.push_back(parse_int(word, source_, field));
  check_count(field, numbers.size(), count);
  return numbers;
}

std::vector<double> HeaderFields::require_doubles(const std::string& field,
                                                  std::size_t count) const {
  std::vector<double> numbers = parse_doubles(require(field), source_, field);
  check_count(field, numbers.size(), count);
  return numbers;
}

void HeaderFields::check_count(const std::string& field, std::size_t found,
                               std::size_t count) const {
  if (found != count) refuse(field, std::to_string(count) + " numbers");
}

void HeaderFields::refuse(const std::string& field, const std::string& constraint) const {
  throw InputError(source_,
                   "'" + field + "' is " + in_quotes(require(field)) + ", must be " + constraint);
}

}  // namespace usct::io
