#include "io/dicom/dicom_dataset.h"

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

/// The text without the blank or NUL by which DICOM pads it to an even length.
std::string_view without_padding(std::string_view text) {
  return trimmed(text.substr(0, text.find('\0')));
}

}  // namespace

bool DicomDataset::has(const Attribute& attribute) const {
  return values_.count(attribute.tag) > 0 || sequences_.count(attribute.tag) > 0;
}

std::string DicomDataset::text(const Attribute& attribute) const {
  const auto found = values_.find(attribute.tag);
  return found == values_.end() ? "" : std::string(without_padding(found->second));
}

std::vector<std::string> DicomDataset::texts(const Attribute& attribute) const {
  std::vector<std::string> parts;
  const std::string all = text(attribute);
  if (all.empty()) return parts;
  for (const std::string_view part : split(all, '\\')) parts.emplace_back(trimmed(part));
  return parts;
}

std::optional<std::vector<double>> DicomDataset::find_numbers(const Attribute& attribute,
                                                              std::size_t count) const {
  const std::vector<std::string> parts = texts(attribute);
  if (parts.empty()) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string& part : parts)
    numbers.push_back(parse_double(part, source_, attribute.name));
  if (numbers.size() != count)
    refuse(attribute, in_quotes(text(attribute)), std::to_string(count) + " numbers");
  return numbers;
}

std::optional<int> DicomDataset::find_integer(const Attribute& attribute) const {
  const std::string value = text(attribute);
  if (value.empty()) return std::nullopt;
  return parse_int(value[0] == '+' ? value.substr(1) : value, source_, attribute.name);
}

std::optional<std::uint16_t> DicomDataset::find_short(const Attribute& attribute) const {
  const auto found = values_.find(attribute.tag);
  if (found == values_.end() || found->second.empty()) return std::nullopt;
  const std::string& bytes = found->second;
  if (bytes.size() != 2)
    refuse(attribute, std::to_string(bytes.size()) + " bytes long", "one number of 2 bytes");
  const auto low = static_cast<std::uint8_t>(bytes[big_endian_ ? 1 : 0]);
  const auto high = static_cast<std::uint8_t>(bytes[big_endian_ ? 0 : 1]);
  return static_cast<std::uint16_t>(low | (high << 8));
}

int DicomDataset::require_short(const Attribute& attribute) const {
  const auto value = find_short(attribute);
  if (!value) refuse_missing(attribute);
  return *value;
}

const std::vector<DicomDataset>& DicomDataset::items(const Attribute& attribute) const {
  static const std::vector<DicomDataset> none;
  const auto found = sequences_.find(attribute.tag);
  return found == sequences_.end() ? none : found->second;
}

void DicomDataset::refuse(const Attribute& attribute, const std::string& value,
                          const std::string& constraint) const {
  throw InputError(source_,
                   "'" + std::string(attribute.name) + "' is " + value + ", must be " + constraint);
}

void DicomDataset::refuse_missing(const Attribute& attribute) const {
  throw InputError(source_, "'" + std::string(attribute.name) + "' is missing");
}

}  // namespace usct::io
