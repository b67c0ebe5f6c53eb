#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/slice_stack.h"

/// The header of one DICOM file, and its pixels.
namespace usct::io {

/// One image, or one frame of a multi-frame image.
struct DicomFrame {
  SlicePose pose;
  double slope = 1.0;
  double intercept = 0.0;
  bool localizer = false;
  /// RescaleType, the unit of the rescaled values. The standard's default for CT is HU.
  std::string unit = "HU";
  std::optional<int> acquisition_number;
};

/// The images in a CT file.
struct DicomImages {
  int columns = 0;
  int rows = 0;
  int bits_allocated = 0;
  int bits_stored = 0;
  bool is_signed = false;
  bool big_endian = false;
  /// The range of stored values, first to second, that means padding.
  std::optional<std::pair<long, long>> padding;
  std::vector<DicomFrame> frames;
  DicomPixelData pixels;

  std::size_t frame_pixels() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
};

enum class DicomKind {
  kCtImage,
  /// A file of modality CT that is no CT image: a report, a dose sheet, a screen capture.
  kOtherCt,
  kOtherModality,
  /// A file that cannot be parsed, but whose meta information states a class of no CT image.
  kNotParsed,
  /// A DICOMDIR, the index of a disc.
  kDirectory
};

struct DicomFile {
  std::filesystem::path path;
  DicomKind kind = DicomKind::kOtherModality;
  std::string series_uid;
  std::string modality;
  std::string frame_of_reference_uid;
  std::string transfer_syntax_uid;
  std::optional<int> series_number;
  /// Only for kCtImage; has no frames if `problem` is not empty.
  DicomImages images;
  /// Reason why the file or its images cannot be read: "'Rows' is 0, must be > 0".
  std::string problem;
};

/// Reads a header; the result is empty if the file is not DICOM. Throws InputError if the file
/// cannot be opened, or if it claims to be DICOM (by its content or its extension) and cannot be
/// parsed, although it might be a slice.
std::optional<DicomFile> read_dicom_header(const std::filesystem::path& path);

/// Hounsfield units of one frame, in the order of rows. Throws InputError, naming the file, if the
/// pixels are cut short or damaged, if their compression is not known, or if a value does not fit
/// int16.
std::vector<std::int16_t> read_dicom_hounsfield(const DicomFile& file, std::size_t frame);

}  // namespace usct::io
