#include "us_ct_registration/phantom/phantom_files.h"

#include <set>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/io/whole_folder.h"

namespace usct::phantom {
namespace {

namespace fs = std::filesystem;

void write_files(const PhantomCase& phantom, const fs::path& folder, const std::string& extension) {
  const PhantomTruth& truth = phantom.truth;
  write_volume(phantom.ct, folder / ("ct" + extension));
  write_volume(phantom.labels, folder / ("labels" + extension));
  write_prescan_nrrd(phantom.ultrasound, folder / "us.nrrd");
  write_T_us_ct(truth.T_us_ct, folder / "truth.tfm");
  write_points_mm(truth.targets_us_mm, folder / "targets.csv");
  write_points_mm(truth.targets_ct_mm, folder / "targets_ct.csv");
  if (!truth.fiducials_us_mm.empty()) {
    write_points_mm(truth.fiducials_us_mm, folder / "fiducials.csv");
    write_points_mm(truth.fiducials_ct_mm, folder / "fiducials_ct.csv");
  }
  write_text(folder / "phantom.json", describe_json(phantom) + '\n');
}

}  // namespace

void require_phantom_folder(const fs::path& folder, const std::string& ct_extension) {
  static const std::set<std::string> kExtensions = {".nrrd", ".mha", ".nii.gz"};
  if (kExtensions.count(ct_extension) == 0)
    throw InputError("CT format", "is '" + ct_extension + "', must be .nrrd, .mha or .nii.gz");
  require_new_folder(folder);
}

void write_phantom(const PhantomCase& phantom, const fs::path& folder,
                   const std::string& ct_extension,
                   const std::function<void(const fs::path&)>& write_more) {
  require_phantom_folder(folder, ct_extension);
  write_whole_folder(folder, [&](const fs::path& temporary) {
    write_files(phantom, temporary, ct_extension);
    if (write_more) write_more(temporary);
  });
}

}  // namespace usct::phantom
