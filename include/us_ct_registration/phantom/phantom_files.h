#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {

/// Throws InputError unless a case can be written to `folder`: it does not exist yet or is empty,
/// and the folder that it lies in exists. `ct_extension` must be ".nrrd", ".mha" or ".nii.gz".
void require_phantom_folder(const std::filesystem::path& folder, const std::string& ct_extension);

/// Writes a case as a folder, all of it or nothing (a temporary folder beside it is renamed):
///
/// | file | content |
/// |---|---|
/// | `ct` + extension | CT, HU, LPS mm |
/// | `labels` + extension | tissue of each CT voxel; names in `phantom.json` |
/// | `us.nrrd` | pre-scan ultrasound with its recorded geometry |
/// | `truth.tfm` | true transform (ITK: maps US points to CT points) |
/// | `targets.csv`, `targets_ct.csv` | the kidney's surface in US and CT mm, point by point |
/// | `fiducials.csv`, `fiducials_ct.csv` | steel balls, where the scene has some |
/// | `phantom.json` | version, seed, options, truth, true geometry |
///
/// `write_more`, if set, adds files of the caller to the folder before it appears. Throws
/// InputError as `require_phantom_folder` does.
void write_phantom(const PhantomCase& phantom, const std::filesystem::path& folder,
                   const std::string& ct_extension,
                   const std::function<void(const std::filesystem::path&)>& write_more = {});

}  // namespace usct::phantom
