#include "fuzz_main.h"
#include "io/dicom/dicom_file.h"
#include "memory_file.h"

namespace usct::fuzz {
namespace {

void append(io::Bytes& out, unsigned tag, const char* vr, const std::string& value) {
  for (const unsigned number : {tag >> 16, tag & 0xffff}) {
    out.push_back(static_cast<std::uint8_t>(number));
    out.push_back(static_cast<std::uint8_t>(number >> 8));
  }
  out.push_back(static_cast<std::uint8_t>(vr[0]));
  out.push_back(static_cast<std::uint8_t>(vr[1]));
  const std::string vr_text(vr);
  const bool long_form = vr_text == "OW" || vr_text == "SQ";
  if (long_form) out.insert(out.end(), 2, 0);
  for (int i = 0; i < (long_form ? 4 : 2); ++i)
    out.push_back(static_cast<std::uint8_t>(value.size() >> (8 * i)));
  out.insert(out.end(), value.begin(), value.end());
}

std::string sequence_of(const io::Bytes& item) {
  io::Bytes out = {0xfe, 0xff, 0x00, 0xe0, 0xff, 0xff, 0xff, 0xff};
  out.insert(out.end(), item.begin(), item.end());
  const io::Bytes end = {0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0};
  out.insert(out.end(), end.begin(), end.end());
  return {out.begin(), out.end()};
}

std::string us(int value) { return {static_cast<char>(value), '\0'}; }

io::Bytes image(bool enhanced) {
  io::Bytes position, groups, positions;
  append(position, 0x00200032, "DS", "1\\2\\3 ");
  append(positions, 0x00209113, "SQ", sequence_of(position));

  io::Bytes out(128, 0);
  for (const char c : {'D', 'I', 'C', 'M'}) out.push_back(static_cast<std::uint8_t>(c));
  append(out, 0x00020010, "UI", std::string("1.2.840.10008.1.2.1\0", 20));
  append(out, 0x00080060, "CS", "CT");
  append(out, 0x0020000e, "UI", "1.2.34");
  append(out, 0x00200032, "DS", "1\\2\\3 ");
  append(out, 0x00200037, "DS", "1\\0\\0\\0\\1\\0 ");
  append(out, 0x00280002, "US", us(1));
  append(out, 0x00280004, "CS", "MONOCHROME2 ");
  append(out, 0x00280008, "IS", "1 ");
  append(out, 0x00280010, "US", us(2));
  append(out, 0x00280011, "US", us(2));
  append(out, 0x00280030, "DS", "1\\1 ");
  append(out, 0x00280100, "US", us(16));
  append(out, 0x00280101, "US", us(16));
  append(out, 0x00280102, "US", us(15));
  append(out, 0x00280103, "US", us(1));
  append(out, 0x00281052, "DS", "0 ");
  append(out, 0x00281053, "DS", "1 ");
  if (enhanced) append(out, 0x52009230, "SQ", sequence_of(positions));
  append(out, 0x7fe00010, "OW", std::string(8, '\1'));
  return out;
}

}  // namespace

std::vector<io::Bytes> seeds() {
  io::Bytes absurd = image(false);
  std::fill(absurd.end() - 12, absurd.end() - 8, 0xfe);  // length of the pixels
  return {image(false), image(true), absurd};
}

void check(const io::Bytes& bytes) {
  const MemoryFile file(bytes);
  const auto header = io::read_dicom_header(file.path());
  if (!header || header->kind != io::DicomKind::kCtImage || !header->problem.empty()) return;
  require(!header->images.frames.empty() && header->images.frame_pixels() > 0);
  std::vector<io::ByteRange> ranges = header->images.pixels.ranges;
  ranges.push_back(header->images.pixels.offset_table);
  for (const io::ByteRange& range : ranges)
    require(range.begin <= bytes.size() && range.length <= bytes.size() - range.begin);
}

}  // namespace usct::fuzz
