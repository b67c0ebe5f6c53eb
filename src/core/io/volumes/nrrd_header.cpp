#include "io/volumes/nrrd_header.h"

#include <algorithm>
#include <string_view>

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

/// Splits bytes into lines, without their line ends.
class LineReader {
 public:
  explicit LineReader(const Bytes& bytes) : text_(text_view(bytes)) {}

  bool at_end() const { return offset_ == text_.size(); }
  std::size_t offset() const { return offset_; }

  std::string_view next() {
    const std::size_t end = std::min(text_.find('\n', offset_), text_.size());
    std::string_view line = text_.substr(offset_, end - offset_);
    offset_ = std::min(end + 1, text_.size());
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  }

 private:
  std::string_view text_;
  std::size_t offset_ = 0;
};

void check_magic(std::string_view line, const std::string& source) {
  constexpr std::string_view kMagic = "NRRD000";
  if (line.size() != kMagic.size() + 1 || line.substr(0, kMagic.size()) != kMagic)
    throw InputError(source, "is not a NRRD file: it begins with " + in_quotes(line));
  if (line.back() < '1' || line.back() > '5')
    throw InputError(source, "is " + in_quotes(line) + ", must be NRRD0001 to NRRD0005");
}

[[noreturn]] void refuse_second(std::string_view name, const std::string& source) {
  throw InputError(source, in_quotes(name) + " is given twice in the header");
}

void parse_line(std::string_view line, NrrdHeader& header, const std::string& source) {
  const std::size_t colon = line.find(':');
  const char next =
      colon == std::string_view::npos || colon + 1 == line.size() ? '\0' : line[colon + 1];
  if (next != '=' && next != ' ')
    throw InputError(
        source, "header line " + in_quotes(line) + " is neither 'field: value' nor 'key:=value'");
  const std::string_view name = line.substr(0, colon);
  const std::string_view value = line.substr(colon + 2);
  if (next == '=') {
    // The format lets a pair be given again; one of the two is not what was meant if they differ.
    if (header.keys.emplace(name, value).first->second != value) refuse_second(name, source);
  } else if (!header.fields.emplace(lower_case(name), trimmed(value)).second) {
    refuse_second(name, source);
  }
}

}  // namespace

const std::string& NrrdHeader::field(const std::string& name, const std::string& source) const {
  const auto it = fields.find(name);
  if (it == fields.end()) throw InputError(source, "header has no field '" + name + "'");
  return it->second;
}

NrrdHeader parse_nrrd_header(const Bytes& bytes, const std::string& source) {
  LineReader lines(bytes);
  check_magic(lines.next(), source);
  NrrdHeader header;
  while (!lines.at_end()) {
    const std::string_view line = lines.next();
    if (line.empty()) break;
    if (line[0] != '#') parse_line(line, header, source);
  }
  header.data_offset = lines.offset();
  return header;
}

}  // namespace usct::io
