#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// The subject of a case: its name after the first '_', or all of it if there is none. The phantoms
/// agar_3001 and patient_3001 have the same kidney, so that they are not independent.
inline std::string subject_of(const std::string& case_name) {
  return case_name.substr(case_name.find('_') + 1);  // npos + 1 is 0
}

/// A folder as `usct phantom` writes it: `ct` (.nrrd, .mha or .nii.gz), `us.nrrd`, `truth.tfm`,
/// `targets.csv` and, if positions of the targets in the CT are known, `targets_ct.csv`.
struct StudyCase {
  /// Name of the folder.
  std::string name;
  CtVolume ct;
  PreScanVolume ultrasound;
  Eigen::Isometry3d T_us_ct_true = Eigen::Isometry3d::Identity();
  /// Matched points: `targets_us_mm[i]` is where `targets_ct_mm[i]` was during the ultrasound,
  /// deformation included. Without `targets_ct.csv` nothing is known of a deformation, and
  /// `targets_ct_mm` are the points that the truth maps to `targets_us_mm`.
  std::vector<Eigen::Vector3d> targets_us_mm;
  std::vector<Eigen::Vector3d> targets_ct_mm;
  /// Whether only the CT and `targets_ct_mm` are there, for the ultrasound of other cases.
  bool is_stranger = false;

  /// The name up to its first '_'.
  std::string group() const { return name.substr(0, name.find('_')); }
  std::string subject() const { return subject_of(name); }
  /// The centroid of the targets: the middle of the kidney.
  Eigen::Vector3d centre_us_mm() const;
  Eigen::Vector3d centre_ct_mm() const;
};

/// Throws InputError, naming the file, if one is missing or invalid, if there are several CTs, or
/// if the files of targets have different numbers of points.
StudyCase read_study_case(const std::filesystem::path& folder);

/// Writes a case that `read_study_case` reads: `ct.nrrd` and the other files, complete or not at
/// all. If `with_targets_ct` is false, `targets_ct_mm` is not written, since nothing is known of a
/// deformation. Throws InputError as `write_whole_folder`.
void write_study_case(const StudyCase& study_case, const std::filesystem::path& folder,
                      bool with_targets_ct = true);

/// Throws InputError, naming `source` and the number of the point (from 1), if a point in the CT's
/// frame, mm, lies outside the CT.
void require_in_ct(const std::vector<Eigen::Vector3d>& points_ct_mm, const CtVolume& ct,
                   const std::string& source);

/// The same of points in the US frame, mm, outside the box along its axes that holds all samples:
/// less exact than the field of view, but other axes or units are found out.
void require_in_ultrasound(const std::vector<Eigen::Vector3d>& points_us_mm, const BeamGrid& beams,
                           const std::string& source);

/// Reads what a study needs of a stranger: the CT, and the targets in it from `targets_ct.csv` or,
/// without that file, from `truth.tfm` and `targets.csv`. Throws InputError, naming the file, if
/// one is missing or invalid.
StudyCase read_stranger(const std::filesystem::path& folder);

}  // namespace usct
