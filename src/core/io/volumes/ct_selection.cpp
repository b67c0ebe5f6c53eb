#include "us_ct_registration/io/volumes/ct_selection.h"

#include <cmath>
#include <utility>

#include "io/format.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

std::string size_text(const Eigen::Vector3i& size) {
  return std::to_string(size.x()) + " x " + std::to_string(size.y()) + " x " +
         std::to_string(size.z());
}

Region region_of(const CtSelection& selection, const Grid& grid) {
  if (!selection.box_mm) return whole(grid);
  std::vector<Eigen::Vector3d> corners;
  for (int corner = 0; corner < 8; ++corner)
    corners.push_back(
        selection.box_mm->corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  return region_around(grid, corners, 0.0);
}

/// The number of voxels as a floating-point number, which does not overflow.
double bytes_of(const Eigen::Vector3i& size, std::size_t voxel_bytes) {
  return size.cast<double>().prod() * static_cast<double>(voxel_bytes);
}

void require_at_most(double bytes, std::uint64_t most, const Eigen::Vector3i& size,
                     const std::string& what, const std::string& source) {
  if (bytes <= static_cast<double>(most)) return;
  constexpr double kMegabyte = 1e6;
  throw InputError(source, size_text(size) + " voxels " + what + " take " +
                               io::format(std::ceil(bytes / kMegabyte)) + " MB, must be at most " +
                               io::format(static_cast<double>(most) / kMegabyte) + " MB");
}

}  // namespace

void CtSelection::validate() const {
  if (box_mm && !(box_mm->min().allFinite() && box_mm->max().allFinite() &&
                  (box_mm->sizes().array() > 0.0).all()))
    throw InputError("CT selection", "the corners of the box are " + io::format(box_mm->min()) +
                                         " and " + io::format(box_mm->max()) +
                                         " mm, must be finite and differ along each axis");
  if (decimation < 1 || decimation > kMostDecimation)
    throw InputError("CT selection", "'decimation' is " + std::to_string(decimation) +
                                         ", must be in [1, " + std::to_string(kMostDecimation) +
                                         "]");
}

void require_fits(const CtSelection& selection, const Grid& grid, std::size_t voxel_bytes,
                  const std::string& source) {
  selection.validate();
  require_at_most(bytes_of(grid.size, voxel_bytes), selection.max_stored_bytes, grid.size,
                  "in the file", source);
  const Region region = region_of(selection, grid);
  if ((region.size.array() < selection.decimation).any())
    throw InputError(source, "the region has " + size_text(region.size) +
                                 " of its voxels, must have at least 'decimation', " +
                                 std::to_string(selection.decimation) + ", along each axis");
  const Eigen::Vector3i kept = region.size / selection.decimation;
  require_at_most(bytes_of(kept, sizeof(std::int16_t)), selection.max_kept_bytes, kept, "to keep",
                  source);
}

CtVolume selected(CtVolume ct, const CtSelection& selection, std::vector<std::string>& warnings) {
  const Region region = region_of(selection, ct.grid);
  const int factor = selection.decimation;
  if (region.size == ct.grid.size && factor == 1) return ct;
  if (region.size != ct.grid.size)
    warnings.push_back("cropped from " + size_text(ct.grid.size) + " to " + size_text(region.size) +
                       " voxels");
  if (factor == 1) return crop(ct, region);
  warnings.push_back("decimated by " + std::to_string(factor) + " along each axis");
  const Volume<float> coarse = shrink(ct, Eigen::Vector3i::Constant(factor), region);
  CtVolume kept(coarse.grid);
  for (std::size_t i = 0; i < kept.voxels.size(); ++i)
    kept.voxels[i] = static_cast<std::int16_t>(std::lround(coarse.voxels[i]));
  return kept;
}

}  // namespace usct
