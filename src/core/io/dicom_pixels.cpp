#include <gdcmPixmapReader.h>
#include <gdcmSequenceOfFragments.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/dicom_file.h"
#include "io/format.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

/// Pixels of one file that need no closer look before memory is allocated for them.
constexpr double kHarmlessBytes = 64.0 * 1024 * 1024;
/// No codec of DICOM shrinks an image further, short of one without content.
constexpr double kLargestRatio = 1000.0;

[[noreturn]] void refuse(const DicomFile& file, const std::string& violation) {
  throw InputError(file.path.string(), violation);
}

bool is_uncompressed(const gdcm::TransferSyntax& syntax) {
  return !syntax.IsEncapsulated() && syntax != gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian;
}

double pixel_bytes(const DicomImages& images) {
  return static_cast<double>(images.frame_pixels()) * static_cast<double>(images.frames.size()) *
         (images.bits_allocated / 8);
}

/// Before GDCM allocates what the header says.
void check_size(const DicomFile& file) {
  const auto file_bytes = static_cast<double>(fs::file_size(file.path));
  const double wanted = pixel_bytes(file.images);
  const gdcm::TransferSyntax::TSType type =
      gdcm::TransferSyntax::GetTSType(file.transfer_syntax_uid.c_str());
  const bool possible =
      type != gdcm::TransferSyntax::TS_END && is_uncompressed(gdcm::TransferSyntax(type))
          ? wanted <= file_bytes
          : wanted <= std::max(kHarmlessBytes, kLargestRatio * file_bytes);
  if (!possible)
    refuse(file, "'Rows' x 'Columns' x frames is " + std::to_string(file.images.rows) + " x " +
                     std::to_string(file.images.columns) + " x " +
                     std::to_string(file.images.frames.size()) + ", " + format(wanted) +
                     " bytes, more than the file of " + format(file_bytes) +
                     " bytes can hold: cut short or damaged");
}

/// Every stream of JPEG, JPEG-LS and JPEG 2000 ends with the marker FF D9, and padding.
bool has_end_marker(const gdcm::ByteValue* fragment) {
  if (fragment == nullptr || fragment->GetPointer() == nullptr) return false;
  const char* data = fragment->GetPointer();
  std::size_t size = fragment->GetLength();
  while (size > 0 && data[size - 1] == '\0') --size;
  return size >= 2 && data[size - 2] == '\xFF' && data[size - 1] == '\xD9';
}

/// GDCM decodes streams that were cut short, to whatever they give.
void check_fragments(const DicomFile& file, const gdcm::DataElement& pixels,
                     const gdcm::TransferSyntax& syntax) {
  const gdcm::SequenceOfFragments* fragments = pixels.GetSequenceOfFragments();
  if (fragments == nullptr) refuse(file, "pixels are not in fragments, as its compression needs");
  const auto count = fragments->GetNumberOfFragments();
  if (count < file.images.frames.size())
    refuse(file, "pixels are in " + std::to_string(count) + " fragments, must be >= " +
                     std::to_string(file.images.frames.size()) + ": cut short or damaged");
  if (syntax == gdcm::TransferSyntax::RLELossless) return;
  const bool one_each = count == file.images.frames.size();
  for (std::size_t i = one_each ? 0 : count - 1; i < count; ++i)
    if (!has_end_marker(fragments->GetFragment(i).GetByteValue()))
      refuse(file, "compressed pixels have no end: cut short or damaged");
}

/// Stored values, little-endian, all frames.
std::vector<char> decode(const DicomFile& file) {
  gdcm::PixmapReader reader;
  reader.SetFileName(file.path.c_str());
  if (!reader.Read())
    refuse(file, "pixels cannot be read: cut short, damaged, or of transfer syntax '" +
                     file.transfer_syntax_uid + "', which is not known");
  const gdcm::Pixmap& pixmap = reader.GetPixmap();
  const gdcm::TransferSyntax& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
  if (syntax.IsEncapsulated()) check_fragments(file, pixmap.GetDataElement(), syntax);
  const auto wanted = static_cast<std::size_t>(pixel_bytes(file.images));
  if (pixmap.GetBufferLength() != wanted)
    refuse(file, "pixels take " + std::to_string(pixmap.GetBufferLength()) + " bytes, must be " +
                     std::to_string(wanted) + " by the header");
  std::vector<char> stored(wanted);
  if (!pixmap.GetBuffer(stored.data()))
    refuse(file, "pixels cannot be decoded: cut short, damaged, or of transfer syntax '" +
                     file.transfer_syntax_uid + "', which is not known");
  return stored;
}

template <typename Raw>
void to_hounsfield(const DicomFile& file, const std::vector<char>& stored,
                   std::vector<std::int16_t>& hounsfield) {
  const DicomImages& images = file.images;
  // Bits above BitsStored may hold anything.
  const int unused = images.bits_allocated - images.bits_stored;
  using Signed = std::make_signed_t<Raw>;
  for (std::size_t frame = 0; frame < images.frames.size(); ++frame) {
    const double slope = images.frames[frame].slope;
    const double intercept = images.frames[frame].intercept;
    const std::size_t begin = frame * images.frame_pixels();
    for (std::size_t i = begin; i < begin + images.frame_pixels(); ++i) {
      Raw raw;
      std::memcpy(&raw, &stored[i * sizeof(Raw)], sizeof(Raw));
      raw = static_cast<Raw>(raw << unused);
      const long value = images.is_signed ? static_cast<long>(static_cast<Signed>(raw) >> unused)
                                          : static_cast<long>(raw >> unused);
      double hu = std::nearbyint(static_cast<double>(value) * slope + intercept);
      if (images.padding && value >= images.padding->first && value <= images.padding->second)
        hu = std::max<double>(hu, kAirHu);
      if (!(hu >= std::numeric_limits<std::int16_t>::min() &&
            hu <= std::numeric_limits<std::int16_t>::max()))
        refuse(file, "a pixel is " + format(hu) + " HU ('RescaleSlope' " + format(slope) +
                         ", 'RescaleIntercept' " + format(intercept) +
                         "), must be from -32768 to 32767");
      hounsfield[i] = static_cast<std::int16_t>(hu);
    }
  }
}

}  // namespace

std::vector<std::int16_t> read_dicom_hounsfield(const DicomFile& file) {
  check_size(file);
  std::vector<char> stored;
  try {
    stored = decode(file);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception&) {  // GDCM's words do not say more
    refuse(file, "pixels cannot be read: cut short or damaged");
  }
  std::vector<std::int16_t> hounsfield(file.images.frame_pixels() * file.images.frames.size());
  if (file.images.bits_allocated == 8)
    to_hounsfield<std::uint8_t>(file, stored, hounsfield);
  else
    to_hounsfield<std::uint16_t>(file, stored, hounsfield);
  return hounsfield;
}

}  // namespace usct::io
