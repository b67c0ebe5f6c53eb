#include "io/gdcm_attributes.h"

#include <gdcmByteValue.h>

#include <cstring>

#include "io/text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

/// DICOM fills up to an even length with a blank or NUL.
std::string_view without_padding(std::string_view text) {
  const std::size_t nul = text.find('\0');
  return trimmed(text.substr(0, nul));
}

}  // namespace

bool Attributes::has(const Attribute& attribute) const {
  return data_.FindDataElement(attribute.tag);
}

std::string Attributes::raw(const Attribute& attribute) const {
  if (!has(attribute)) return {};
  const gdcm::ByteValue* bytes = data_.GetDataElement(attribute.tag).GetByteValue();
  if (bytes == nullptr || bytes->GetPointer() == nullptr) return {};
  return {bytes->GetPointer(), bytes->GetLength()};
}

std::string Attributes::text(const Attribute& attribute) const {
  return std::string(without_padding(raw(attribute)));
}

std::vector<std::string> Attributes::texts(const Attribute& attribute) const {
  std::vector<std::string> parts;
  const std::string all = text(attribute);
  if (all.empty()) return parts;
  for (const std::string_view part : split(all, '\\')) parts.emplace_back(trimmed(part));
  return parts;
}

std::optional<std::vector<double>> Attributes::find_numbers(const Attribute& attribute,
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

std::optional<int> Attributes::find_integer(const Attribute& attribute) const {
  const std::string value = text(attribute);
  if (value.empty()) return std::nullopt;
  return parse_int(value[0] == '+' ? value.substr(1) : value, source_, attribute.name);
}

std::optional<std::uint16_t> Attributes::find_short(const Attribute& attribute) const {
  const std::string bytes = raw(attribute);
  if (bytes.empty()) return std::nullopt;
  std::uint16_t value = 0;
  if (bytes.size() != sizeof(value))
    refuse(attribute, std::to_string(bytes.size()) + " bytes long", "one number of 2 bytes");
  std::memcpy(&value, bytes.data(), sizeof(value));
  return value;
}

int Attributes::require_short(const Attribute& attribute) const {
  const auto value = find_short(attribute);
  if (!value) refuse_missing(attribute);
  return *value;
}

std::vector<gdcm::DataSet> Attributes::items(const Attribute& attribute) const {
  std::vector<gdcm::DataSet> found;
  if (!has(attribute)) return found;
  const auto sequence = data_.GetDataElement(attribute.tag).GetValueAsSQ();
  if (!sequence) return found;
  for (gdcm::SequenceOfItems::SizeType i = 1; i <= sequence->GetNumberOfItems(); ++i)
    found.push_back(sequence->GetItem(i).GetNestedDataSet());
  return found;
}

void Attributes::refuse(const Attribute& attribute, const std::string& value,
                        const std::string& constraint) const {
  throw InputError(source_,
                   "'" + std::string(attribute.name) + "' is " + value + ", must be " + constraint);
}

void Attributes::refuse_missing(const Attribute& attribute) const {
  throw InputError(source_, "'" + std::string(attribute.name) + "' is missing");
}

}  // namespace usct::io
