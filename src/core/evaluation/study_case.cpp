#include "us_ct_registration/evaluation/study_case.h"

#include "geometry/centroid.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

std::string name_of(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();
}

fs::path find_ct(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const char* name : {"ct.nrrd", "ct.mha", "ct.nii.gz"})
    if (fs::exists(folder / name)) found.push_back(folder / name);
  if (found.size() != 1)
    throw InputError(folder.string(), "has " + std::to_string(found.size()) +
                                          " of ct.nrrd, ct.mha and ct.nii.gz, must have one");
  return found.front();
}

}  // namespace

Vector3d StudyCase::centre_us_mm() const { return centroid(targets_us_mm); }

Vector3d StudyCase::centre_ct_mm() const { return centroid(targets_ct_mm); }

StudyCase read_study_case(const fs::path& folder) {
  StudyCase study_case;
  study_case.name = name_of(folder);
  study_case.ct = read_volume<std::int16_t>(find_ct(folder));
  study_case.ultrasound = read_prescan_nrrd(folder / "us.nrrd");
  study_case.T_us_ct_true = read_T_us_ct(folder / "truth.tfm");
  study_case.targets_us_mm = read_points_mm(folder / "targets.csv");
  const fs::path in_ct = folder / "targets_ct.csv";
  study_case.targets_ct_mm = fs::exists(in_ct)
                                 ? read_points_mm(in_ct)
                                 : ct_points_mm(study_case.T_us_ct_true, study_case.targets_us_mm);
  if (study_case.targets_ct_mm.size() != study_case.targets_us_mm.size())
    throw InputError(in_ct.string(), "has " + std::to_string(study_case.targets_ct_mm.size()) +
                                         " points, must have as many as targets.csv, " +
                                         std::to_string(study_case.targets_us_mm.size()));
  return study_case;
}

StudyCase read_stranger(const fs::path& folder) {
  StudyCase stranger;
  stranger.name = name_of(folder);
  stranger.is_stranger = true;
  stranger.ct = read_volume<std::int16_t>(find_ct(folder));
  if (fs::exists(folder / "targets_ct.csv"))
    stranger.targets_ct_mm = read_points_mm(folder / "targets_ct.csv");
  else if (fs::exists(folder / "truth.tfm"))
    stranger.targets_ct_mm =
        ct_points_mm(read_T_us_ct(folder / "truth.tfm"), read_points_mm(folder / "targets.csv"));
  else
    throw InputError(folder.string(),
                     "has no targets_ct.csv, must have it (or truth.tfm and targets.csv), since it "
                     "tells where the kidney is");
  return stranger;
}

}  // namespace usct
