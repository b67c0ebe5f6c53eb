#include "registration/search/ct_sampler.h"

namespace usct::registration {
namespace {

/// The bytes of a word of PackedGradient: the value of a voxel and of its neighbour along j, then
/// their gradients.
Eigen::Array4f bytes_of(std::uint32_t word) {
  const auto byte = [&](int shift) { return static_cast<int>(word >> shift & 255U); };
  return Eigen::Array4i(byte(0), byte(8), byte(16), byte(24)).cast<float>();
}

}  // namespace

CtSampler::CtSampler(const PackedCt& ct)
    : ct_(ct), packed_(ct.gradient()), cells_((ct.grid().size.array() - 1).cast<double>()) {}

Eigen::Array2f CtSampler::at(const Eigen::Vector3d& index) const {
  // The comparisons are false for what is not a number.
  const auto is_inside = [&](int axis) { return index[axis] >= 0.0 && index[axis] < cells_[axis]; };
  if (!is_inside(0) || !is_inside(1) || !is_inside(2))
    return {static_cast<float>(ct_.background()), 0.0F};
  const Eigen::Vector3i cell = index.cast<int>();
  const Eigen::Vector3f t = (index - cell.cast<double>()).cast<float>();
  const std::uint32_t* low = packed_.words + static_cast<std::size_t>(cell.x()) +
                             static_cast<std::size_t>(cell.y()) * ct_.stride_j() +
                             static_cast<std::size_t>(cell.z()) * ct_.stride_k();
  const auto along_i = [&](const std::uint32_t* first) -> Eigen::Array4f {
    const Eigen::Array4f here = bytes_of(first[0]);
    return here + t.x() * (bytes_of(first[1]) - here);
  };
  const Eigen::Array4f face = along_i(low);
  const Eigen::Array4f edge = face + t.z() * (along_i(low + ct_.stride_k()) - face);
  return {edge[0] + t.y() * (edge[1] - edge[0]), edge[2] + t.y() * (edge[3] - edge[2])};
}

void CtSampler::sample(const Eigen::Vector3d& first, const Eigen::Vector3d& step, std::size_t count,
                       float* value, float* gradient) const {
  const auto hu = static_cast<float>(ct_.step_hu());
  const auto hu_per_mm = static_cast<float>(ct_.step_hu() * packed_.step_per_mm);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Array2f here = at(first + static_cast<double>(i) * step);
    value[i] = hu * here.x();
    gradient[i] = hu_per_mm * here.y();
  }
}

}  // namespace usct::registration
