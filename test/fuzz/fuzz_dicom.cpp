#include <sys/mman.h>
#include <unistd.h>

#include "fuzz_main.h"
#include "io/dicom_dataset.h"

namespace usct::fuzz {
namespace {

const io::Attribute kSyntax{"TransferSyntaxUID", 0x00020010};
const io::Attribute kRows{"Rows", 0x00280010};
const io::Attribute kPosition{"ImagePositionPatient", 0x00200032};
const io::Attribute kFrames{"PerFrameFunctionalGroupsSequence", 0x52009230};

/// Explicit VR, little-endian; a length of two bytes.
std::string element(const io::Attribute& attribute, const std::string& vr,
                    const std::string& value) {
  const auto byte = [](std::uint32_t word, int i) {
    return static_cast<char>(word >> (8 * i) & 0xff);
  };
  const std::uint32_t group = attribute.tag >> 16;
  const std::uint32_t number = attribute.tag & 0xffff;
  const auto length = static_cast<std::uint32_t>(value.size());
  return std::string{byte(group, 0), byte(group, 1), byte(number, 0), byte(number, 1)} + vr +
         std::string{byte(length, 0), byte(length, 1)} + value;
}

/// A sequence of one item and pixel data, both of undefined length.
std::string file_with_sequence() {
  const std::string undefined(4, '\xff');
  const std::string item = std::string("\xfe\xff\x00\xe0", 4) + undefined +
                           element(kPosition, "DS", "1.5\\-2\\3.25 ") +
                           std::string("\xfe\xff\x0d\xe0\0\0\0\0", 8);
  const std::string sequence = std::string("\x00\x52\x30\x92SQ\0\0", 8) + undefined + item +
                               std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
  const std::string pixels = std::string("\xe0\x7f\x10\x00OB\0\0", 8) + undefined +
                             std::string("\xfe\xff\x00\xe0\0\0\0\0", 8) +
                             std::string("\xfe\xff\x00\xe0\x02\0\0\0", 8) + "ab" +
                             std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
  return std::string(128, '\0') + "DICM" +
         element(kSyntax, "UI", std::string("1.2.840.10008.1.2.4.90", 22)) +
         element(kRows, "US", std::string("\x00\x02", 2)) + sequence + pixels;
}

/// The parser reads files, so the bytes get a file in memory.
class MemoryFile {
 public:
  explicit MemoryFile(const io::Bytes& bytes) : descriptor_(memfd_create("fuzz", 0)) {
    const auto size = static_cast<ssize_t>(bytes.size());
    require(descriptor_ >= 0 && write(descriptor_, bytes.data(), bytes.size()) == size);
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

}  // namespace

std::vector<io::Bytes> seeds() {
  const std::string good = file_with_sequence();
  std::string absurd = good;
  absurd.replace(absurd.size() - 14, 4, "\xff\xff\xff\x7f");  // length of a fragment
  // Our seeds are good ones, or nothing behind the first refusal would be tried.
  const MemoryFile file(bytes_of(good));
  const io::DicomContent content = io::parse_dicom(file.path(), {{kRows}, {kFrames}});
  require(content.data.items(kFrames).size() == 1 && content.pixels->ranges.size() == 1);
  return {bytes_of(good), bytes_of(absurd)};
}

void check(const io::Bytes& bytes) {
  const MemoryFile file(bytes);
  const io::DicomContent content = io::parse_dicom(file.path(), {{kRows, kPosition}, {kFrames}});
  if (content.pixels)
    for (const io::ByteRange& range : content.pixels->ranges)
      require(range.begin <= bytes.size() && range.length <= bytes.size() - range.begin);
  content.data.find_short(kRows);
  for (const io::DicomDataset& frame : content.data.items(kFrames))
    frame.find_numbers(kPosition, 3);
}

}  // namespace usct::fuzz
