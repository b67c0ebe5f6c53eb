#pragma once

#include <gdcmDataSet.h>
#include <gdcmSequenceOfItems.h>

#include <optional>
#include <string>
#include <vector>

namespace usct::io {

/// A DICOM attribute that this code reads. There is none that identifies a patient, and none of
/// free text.
struct Attribute {
  const char* name;
  gdcm::Tag tag;
};

/// The attributes of a data set, or of an item of a sequence in it.
class Attributes {
 public:
  Attributes(std::string source, const gdcm::DataSet& data)
      : source_(std::move(source)), data_(data) {}

  const std::string& source() const { return source_; }
  bool has(const Attribute& attribute) const;

  /// Without padding; empty if there is none.
  std::string text(const Attribute& attribute) const;
  std::vector<std::string> texts(const Attribute& attribute) const;

  /// Decimal or integer strings. Throw InputError, naming the attribute, if it is there and is not
  /// `count` finite numbers.
  std::optional<std::vector<double>> find_numbers(const Attribute& attribute,
                                                  std::size_t count) const;
  std::optional<int> find_integer(const Attribute& attribute) const;

  /// The 16-bit value of an attribute of US or SS, as unsigned.
  std::optional<std::uint16_t> find_short(const Attribute& attribute) const;
  int require_short(const Attribute& attribute) const;

  /// The items of a sequence; none if it is not there.
  std::vector<gdcm::DataSet> items(const Attribute& attribute) const;

  [[noreturn]] void refuse(const Attribute& attribute, const std::string& value,
                           const std::string& constraint) const;
  [[noreturn]] void refuse_missing(const Attribute& attribute) const;

 private:
  std::string raw(const Attribute& attribute) const;

  std::string source_;
  const gdcm::DataSet& data_;
};

}  // namespace usct::io
