#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/dicom/dicom_file.h"
#include "io/dicom/slice_stack.h"
#include "us_ct_registration/io/dicom/dicom.h"

/// Selects the slices of one series from a folder of files.
namespace usct::io {

/// The files of a path.
struct DicomScan {
  /// Files in the order of their paths.
  std::vector<DicomFile> files;
  std::vector<std::filesystem::path> not_dicom;
  /// Files that cannot be parsed, but state that they are no CT images.
  std::vector<std::filesystem::path> not_parsed;
  std::vector<std::filesystem::path> linked_folders;  // not followed
};

/// The files of a folder with all its subfolders; or, for a file, those of its series in its own
/// folder. Throws InputError if the path cannot be read, is no DICOM file, or is a folder without
/// one.
DicomScan scan_dicom(const std::filesystem::path& path);

/// The files of one series in a scan, which must outlive it. At least one of the lists has a file.
struct Series {
  /// Files with slices.
  std::vector<const DicomFile*> images;
  /// Reports, captures and images of other modalities.
  std::vector<const DicomFile*> others;

  const DicomFile& first() const { return images.empty() ? *others.front() : *images.front(); }
  bool is_ct() const { return !images.empty(); }
};

/// Series by their number (series without one come first), then UID.
std::vector<Series> group_by_series(const DicomScan& scan);

/// The series that the options choose. Throws InputError, listing all series, unless exactly one
/// series of CT matches.
const Series& choose_series(const std::filesystem::path& path, const std::vector<Series>& all,
                            const DicomReadOptions& options);

/// One frame of a file.
struct Slice {
  const DicomFile* file;
  std::size_t frame;

  const DicomFrame& info() const { return file->images.frames[frame]; }
};

/// The slices of a series without its localizers, by acquisition; only those of the chosen
/// acquisition, if the options choose one.
std::vector<Slice> slices_of(const Series& series, const DicomReadOptions& options);

std::vector<SlicePose> poses_of(const std::vector<Slice>& slices);

/// Stacks the slices as `stack_slices` does; slices of different frames of reference, of different
/// units, or of acquisitions that alternate form no stack either.
SliceStack stack_of(const std::vector<Slice>& slices, double tolerance);

}  // namespace usct::io
