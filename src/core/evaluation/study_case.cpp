#include "us_ct_registration/evaluation/study_case.h"

#include "geometry/centroid.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/io/whole_folder.h"
#include "us_ct_registration/registration/landmarks.h"
#include "us_ct_registration/volume/sampling.h"

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

/// The smallest box along the axes that holds the points.
using Box = Eigen::AlignedBox3d;

template <typename Contains>
void require_all(const std::vector<Vector3d>& points_mm, const Contains& contains, const Box& box,
                 const std::string& what, const std::string& source) {
  for (std::size_t i = 0; i < points_mm.size(); ++i)
    if (!contains(points_mm[i]))
      throw InputError(
          source,
          formatted("point %zu is (%.1f, %.1f, %.1f) mm, must lie in %s: (%.1f, %.1f, %.1f) to "
                    "(%.1f, %.1f, %.1f) mm",
                    i + 1, points_mm[i].x(), points_mm[i].y(), points_mm[i].z(), what.c_str(),
                    box.min().x(), box.min().y(), box.min().z(), box.max().x(), box.max().y(),
                    box.max().z()));
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
  require_same_count(in_ct.string(), study_case.targets_ct_mm.size(), "targets.csv",
                     study_case.targets_us_mm.size());
  return study_case;
}

void write_study_case(const StudyCase& study_case, const fs::path& folder, bool with_targets_ct) {
  write_whole_folder(folder, [&](const fs::path& made) {
    write_volume(study_case.ct, made / "ct.nrrd");
    write_prescan_nrrd(study_case.ultrasound, made / "us.nrrd");
    write_T_us_ct(study_case.T_us_ct_true, made / "truth.tfm");
    write_points_mm(study_case.targets_us_mm, made / "targets.csv");
    if (with_targets_ct) write_points_mm(study_case.targets_ct_mm, made / "targets_ct.csv");
  });
}

void require_in_ct(const std::vector<Vector3d>& points_ct_mm, const CtVolume& ct,
                   const std::string& source) {
  Box box;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Array3d ends(corner & 1, corner >> 1 & 1, corner >> 2);
    box.extend(
        ct.grid.physical_from_index((ends * ct.grid.size.cast<double>().array() - 0.5).matrix()));
  }
  const auto contains = [&](const Vector3d& p_mm) {
    return contains_index(ct.grid, ct.grid.index_from_physical(p_mm));
  };
  require_all(points_ct_mm, contains, box, "the CT (LPS: x to the left, y to the back)", source);
}

void require_in_ultrasound(const std::vector<Vector3d>& points_us_mm, const BeamGrid& beams,
                           const std::string& source) {
  const Box box = beams.bounding_box();
  const auto contains = [&](const Vector3d& p_mm) { return box.contains(p_mm); };
  require_all(points_us_mm, contains, box, "the ultrasound", source);
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
