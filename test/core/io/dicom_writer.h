#pragma once

#include <gdcmTag.h>

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/io/example_volumes.h"

namespace usct::test {

/// One CT slice to write, sampled from a function of the position in the patient.
struct DicomSlice {
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 2> axes = Eigen::Matrix<double, 3, 2>::Identity();
  Eigen::Vector2d spacing_mm = {0.75, 1.25};
  Eigen::Vector2i size = {16, 12};  // columns, rows

  double slope = 1.0;
  double intercept = -8192.0;
  std::string rescale_type = "HU";
  bool is_signed = false;
  int bits_allocated = 16;
  int bits_stored = 16;
  /// Value of the bits above bits_stored, which a reader must ignore.
  int unused_bits = 0;

  std::string series_uid = "1.2.826.0.1.3680043.2.1.1";
  std::string sop_class = "1.2.840.10008.5.1.4.1.1.2";
  std::string modality = "CT";
  std::string frame_of_reference_uid = "1.2.826.0.1.3680043.2.9";
  std::string image_type = "ORIGINAL\\PRIMARY\\AXIAL";
  int series_number = 1;
  int instance_number = 1;
  int acquisition_number = 1;

  std::function<double(const Eigen::Vector3d&)> hounsfield = hounsfield_at;

  /// Final changes: attributes are replaced by these bytes, or added; or removed if empty.
  std::map<gdcm::Tag, std::optional<std::string>> changes;
};

/// Bytes of a value of type US or SS.
std::string short_bytes(int value);

/// Writes explicit VR little endian, with a patient's name, identifiers and free text.
void write_dicom(const std::filesystem::path& path, const DicomSlice& slice);

/// Writes an enhanced (multi-frame) CT, with a position and rescale for each frame and shared
/// orientation and pixel measures.
void write_enhanced_dicom(const std::filesystem::path& path, const std::vector<DicomSlice>& frames);

/// All texts that identify the patient in the files above.
std::vector<std::string> patient_identifiers();

/// The slices of a grid, along its third axis.
std::vector<DicomSlice> slices_of(const Grid& grid);

/// Writes slice_0.dcm and so on; names and instance numbers are not in the order of positions.
void write_shuffled(const std::filesystem::path& folder, std::vector<DicomSlice> slices);

}  // namespace usct::test
