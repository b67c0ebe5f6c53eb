#include "phantom/ct_masks.h"

#include <vector>

#include "us_ct_registration/error.h"
#include "us_ct_registration/volume/operations.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Every n-th voxel of the CT, 255 if it is not air.
MaskVolume coarse_body_candidates(const CtVolume& ct) {
  const Vector3i step = (kBodyVoxelMm / ct.grid.spacing_mm.array()).round().max(1.0).cast<int>();
  Grid grid = ct.grid;
  grid.size = ((ct.grid.size.array() - 1) / step.array() + 1).matrix();
  grid.spacing_mm = ct.grid.spacing_mm.cwiseProduct(step.cast<double>());
  MaskVolume mask(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        mask.at(i, j, k) =
            static_cast<float>(ct.at(i * step.x(), j * step.y(), k * step.z())) > kAirHu ? 255 : 0;
  return mask;
}

/// Marks with `mark` all voxels of value `value` that connect to `seed` by faces; returns their
/// number.
std::size_t flood(MaskVolume& mask, const Vector3i& seed, std::uint8_t value, std::uint8_t mark) {
  std::vector<Vector3i> front = {seed};
  mask.at(seed.x(), seed.y(), seed.z()) = mark;
  std::size_t count = 0;
  while (!front.empty()) {
    const Vector3i v = front.back();
    front.pop_back();
    ++count;
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        Vector3i n = v;
        n[axis] += step;
        if (n[axis] < 0 || n[axis] >= mask.grid.size[axis]) continue;
        std::uint8_t& m = mask.at(n.x(), n.y(), n.z());
        if (m != value) continue;
        m = mark;
        front.push_back(n);
      }
  }
  return count;
}

}  // namespace

MaskVolume body_mask(const CtVolume& ct) {
  MaskVolume mask = coarse_body_candidates(ct);
  const Vector3i& size = mask.grid.size;
  std::size_t largest = 0;
  Vector3i seed_of_largest = Vector3i::Zero();
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        if (mask.at(i, j, k) != 255) continue;
        const std::size_t count = flood(mask, {i, j, k}, 255, 1);
        if (count > largest) {
          largest = count;
          seed_of_largest = {i, j, k};
        }
      }
  if (largest < 1000)
    throw InputError(kFromCt, "the CT holds no body (no connected region above -300 HU)");
  flood(mask, seed_of_largest, 1, 2);
  for (std::uint8_t& m : mask.voxels) m = m == 2 ? 255 : 0;
  // Outer air touches the sides of the volume, not only its first and last axial slice (lungs do).
  const Vector3d up = mask.grid.direction.transpose() * Vector3d::UnitZ();
  int superior = 0;
  up.cwiseAbs().maxCoeff(&superior);
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Vector3i v(i, j, k);
        bool at_side = false;
        for (int axis = 0; axis < 3; ++axis)
          at_side |= axis != superior && (v[axis] == 0 || v[axis] == size[axis] - 1);
        if (at_side && mask.at(i, j, k) == 0) flood(mask, v, 0, 1);
      }
  for (std::uint8_t& m : mask.voxels) m = m == 1 ? 0 : 255;
  return mask;
}

MaskVolume mask_of_label(const LabelVolume& labels, int label) {
  std::vector<Vector3d> points;
  for (int k = 0; k < labels.grid.size.z(); ++k)
    for (int j = 0; j < labels.grid.size.y(); ++j)
      for (int i = 0; i < labels.grid.size.x(); ++i)
        if (labels.at(i, j, k) == label)
          points.push_back(labels.grid.physical_from_index(Vector3d(i, j, k)));
  if (points.empty())
    throw InputError(kFromCt, "label " + std::to_string(label) + " is not in the label map");
  const LabelVolume part = crop(labels, region_around(labels.grid, points, 30.0));
  MaskVolume mask(part.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    mask.voxels[i] = part.voxels[i] == label ? 255 : 0;
  return mask;
}

}  // namespace usct::phantom
