#include <gdcmBitmap.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>

#include "io/dicom/gdcm_codecs.h"

namespace usct::io {
namespace {

using Bytes = std::vector<std::uint8_t>;

void silence_gdcm() {
  static const bool once = [] {
    gdcm::Trace::DebugOff();
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    return true;
  }();
  static_cast<void>(once);
}

gdcm::PixelFormat pixel_format(const FrameFormat& format, bool is_jpeg_12) {
  // GDCM begins with the decoder for the bits that are allocated. If the stream has other bits, it
  // takes the right one only after that has printed an error.
  if (is_jpeg_12) return format.is_signed ? gdcm::PixelFormat::INT12 : gdcm::PixelFormat::UINT12;
  const auto stored = static_cast<std::uint16_t>(format.bits_stored);
  return gdcm::PixelFormat(1, static_cast<std::uint16_t>(format.bits_allocated), stored,
                           static_cast<std::uint16_t>(stored - 1),
                           static_cast<std::uint16_t>(format.is_signed));
}

std::optional<Bytes> decode(const std::string& transfer_syntax_uid, const FrameFormat& format,
                            bool is_jpeg_12, const Bytes& stream) {
  silence_gdcm();
  gdcm::Fragment fragment;
  fragment.SetByteValue(reinterpret_cast<const char*>(stream.data()),
                        static_cast<std::uint32_t>(stream.size()));
  gdcm::SmartPointer<gdcm::SequenceOfFragments> fragments = new gdcm::SequenceOfFragments;
  fragments->AddFragment(fragment);
  gdcm::DataElement pixels(gdcm::Tag(0x7fe0, 0x0010));
  pixels.SetValue(*fragments);

  gdcm::Bitmap bitmap;
  bitmap.SetNumberOfDimensions(2);
  bitmap.SetDimension(0, static_cast<unsigned>(format.columns));
  bitmap.SetDimension(1, static_cast<unsigned>(format.rows));
  bitmap.SetPixelFormat(pixel_format(format, is_jpeg_12));
  bitmap.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  bitmap.SetTransferSyntax(gdcm::TransferSyntax::GetTSType(transfer_syntax_uid.c_str()));
  bitmap.SetDataElement(pixels);
  Bytes out(format.bytes());
  bool decoded = false;
  try {
    decoded = bitmap.GetBufferLength() == out.size() &&
              bitmap.GetBuffer(reinterpret_cast<char*>(out.data()));
  } catch (const std::exception&) {  // the message of the exception says no more than ours
  }
  if (!decoded) return std::nullopt;
  return out;
}

}  // namespace
}  // namespace usct::io

extern "C" const void* usct_module() {
  static const usct::io::GdcmCodecs functions{usct::io::decode};
  return &functions;
}
