#include "registration/search/unpacked_ct.h"

namespace usct::registration {

using Eigen::Vector3d;

UnpackedCt::UnpackedCt(const PackedCt& ct)
    : grid_(ct.grid()), background_hu_(static_cast<float>(ct.background() * ct.step_hu())) {
  const PackedGradient packed = ct.gradient();
  const Voxel scale(ct.step_hu(), ct.step_hu() * packed.step_per_mm);
  voxels_.reserve(grid_.voxel_count());
  const Eigen::Vector3i& size = grid_.size;
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j) {
      // The last row is the second one of the pairs before it.
      const bool is_last = j + 1 == size.y();
      const std::uint32_t* words = packed.words + static_cast<std::size_t>(k) * ct.stride_k() +
                                   static_cast<std::size_t>(j - (is_last ? 1 : 0)) * ct.stride_j();
      for (int i = 0; i < size.x(); ++i) {
        const std::uint32_t word = words[i] >> (is_last ? 8U : 0U);
        voxels_.push_back(
            scale * Voxel(static_cast<float>(word & 255U), static_cast<float>(word >> 16U & 255U)));
      }
    }
}

UnpackedCt::Voxel UnpackedCt::at(const Vector3d& index) const {
  const Vector3d floor = index.array().floor();
  if ((floor.array() < 0.0).any() ||
      (floor.array() + 1.0 >= grid_.size.cast<double>().array()).any())
    return {background_hu_, 0.0F};
  const Eigen::Vector3f w = (index - floor).cast<float>();
  const auto row = static_cast<std::size_t>(grid_.size.x());
  const std::size_t slice = row * static_cast<std::size_t>(grid_.size.y());
  const Voxel* v = voxels_.data() + static_cast<std::size_t>(floor.x()) +
                   row * static_cast<std::size_t>(floor.y()) +
                   slice * static_cast<std::size_t>(floor.z());
  const auto along_x = [&](const Voxel* first) -> Voxel {
    return first[0] + w.x() * (first[1] - first[0]);
  };
  const auto along_y = [&](const Voxel* first) -> Voxel {
    const Voxel low = along_x(first);
    return low + w.y() * (along_x(first + row) - low);
  };
  const Voxel low = along_y(v);
  return low + w.z() * (along_y(v + slice) - low);
}

void UnpackedCt::sample(const Vector3d& first, const Vector3d& step, std::size_t count,
                        float* value, float* gradient) const {
  for (std::size_t i = 0; i < count; ++i) {
    const Voxel here = at(first + static_cast<double>(i) * step);
    value[i] = here.x();
    gradient[i] = here.y();
  }
}

}  // namespace usct::registration
