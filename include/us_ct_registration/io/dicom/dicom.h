#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/io/volumes/ct_selection.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/volume/volume.h"

/// CT series in DICOM files: CT, enhanced (multi-frame) CT and legacy converted enhanced CT images;
/// not compressed, or JPEG, JPEG-LS, JPEG 2000 or RLE.
///
/// No patient identifier and no free text leaves the reader. Messages hold file names, UIDs,
/// geometry and the values of technical fields only.
///
/// Files without DICOM content are skipped and counted. A file that claims to be DICOM (by its
/// content, or by the extension .dcm or .ima) and cannot be read is an error, because it might be a
/// slice; unless its meta information states that it is no CT image.
namespace usct {

/// A summary of the headers of one series; see find_dicom_series.
struct DicomSeries {
  /// Empty if the files do not state it (some anonymisers erase it).
  std::string series_uid;
  /// "CT", "MR" and so on.
  std::string modality;
  std::string frame_of_reference_uid;
  std::string transfer_syntax_uid;
  std::optional<int> series_number;
  /// Whether the series holds CT images, which read_dicom_ct reads. The fields below are known only
  /// for these.
  bool is_ct = false;
  int files = 0;
  /// Number of images, or of frames of multi-frame images, without localizers; those at one place
  /// count once, if they form a stack.
  int slices = 0;
  int columns = 0;
  int rows = 0;
  /// Columns: the unit directions of increasing column and row index, LPS.
  Eigen::Matrix<double, 3, 2> axes = Eigen::Matrix<double, 3, 2>::Zero();
  /// Distance between columns, between rows, and between slices by their positions (the median if
  /// they are uneven; 0 for a single slice).
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Zero();
  /// Reasons why read_dicom_ct would refuse the series, or would have to resample it.
  std::vector<std::string> problems;
  /// The first of its files by name.
  std::filesystem::path first_file;
};

struct DicomReadOptions {
  /// The series to read; required if there are several CT series. Empty: the only one.
  std::string series_uid;

  /// Only images with this AcquisitionNumber are read, for series with several scans of the same
  /// region (phases of contrast).
  std::optional<int> acquisition_number;

  /// Treatment of slices that are not on a regular grid: gantry tilt, uneven spacing, missing
  /// slices. false: refuse. true: interpolate linearly between the slices' true positions onto a
  /// regular grid, with a warning that says so. Its axes are the slices' axes and their normal, its
  /// slice spacing the smallest one between neighbours; it covers all slices, and is -1024 HU where
  /// there is no slice.
  bool resample_irregular = false;

  /// Greatest distance of a slice from its place on the regular grid, as a fraction of the slice
  /// spacing. Must be > 0 and <= 0.5.
  double position_tolerance = 0.05;

  /// Throws InputError naming the option, its value and the constraint.
  void validate() const;
};

/// A CT as it was read.
struct LoadedCt {
  CtVolume volume;
  /// The grid of the whole CT, of which `volume` may be a part.
  Grid whole_grid;
  /// "DICOM", or the format of the image file.
  std::string format;
  /// Empty for image files, or where the files do not state it.
  std::string series_uid;
  std::string frame_of_reference_uid;
  /// Warnings about anything that was skipped, resampled or unusual.
  std::vector<std::string> warnings;
};

/// The series in a folder and all its subfolders, or the one series that a file belongs to (whose
/// other files are looked for in the same folder); by series number, then UID.
///
/// Throws InputError if the path does not exist or cannot be read, or if a DICOM file cannot be
/// parsed.
std::vector<DicomSeries> find_dicom_series(const std::filesystem::path& path);

/// The CT volume of a folder (with subfolders) or of the series that a file belongs to.
///
/// Slices are ordered by their positions along their normal, never by name or number; the spacing
/// comes from the positions. Voxels are Hounsfield units, by each slice's own rescale slope and
/// intercept, rounded to nearest; values outside int16 are an error. Padding (PixelPaddingValue, to
/// PixelPaddingRangeLimit) below -1024 or above 2000 HU becomes -1024 HU, the value of air, with a
/// warning if it stands for more than air; between them it may be tissue, and stays. Slices that
/// differ in RescaleType are an error; one that is not HU is a warning. Localizers, other
/// modalities and files that are no CT images are skipped with a warning. Of slices at the same
/// place with the same pixels one is used, with a warning; different pixels are an error.
///
/// Throws InputError, naming the file or the series and the fault, for files that cannot be read
/// and, unless options.resample_irregular, for slices that are not on a regular grid; and, before
/// pixels are decompressed, for a CT beyond the limits of the selection.
LoadedCt read_dicom_ct(const std::filesystem::path& path, const DicomReadOptions& options = {},
                       const Progress& progress = {}, const CtSelection& selection = {});

/// Throws InputError if a series or an acquisition is chosen, for a file that is not DICOM.
void require_no_choice(const DicomReadOptions& options, const std::string& source);

/// The CT at `path`, which is a folder of DICOM files, a DICOM file (see read_dicom_ct), or an
/// image file (see volume_io.h), of which no series or acquisition can be chosen. Throws
/// InputError.
LoadedCt read_ct(const std::filesystem::path& path, const DicomReadOptions& options = {},
                 const Progress& progress = {}, const CtSelection& selection = {});

/// Whether the path is a folder, a file that begins as DICOM files do (a preamble of 128 bytes,
/// then "DICM"), or a file without preamble that can be read as DICOM. False for anything else,
/// also for a file that cannot be opened.
bool is_dicom(const std::filesystem::path& path);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_dicom(const std::filesystem::path& path);

}  // namespace usct
