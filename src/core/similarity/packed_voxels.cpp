#include "similarity/packed_voxels.h"

#include <algorithm>

#include "parallel.h"
#include "require.h"
#include "similarity/packed_gradient.h"

namespace usct {
namespace {

/// Kernels address words of four bytes by 32-bit numbers with a sign.
constexpr std::size_t kMostPackedVoxels = std::size_t{1} << 29;

}  // namespace

Volume<std::uint8_t> in_bytes(const Volume<float>& hu, const HuWindow& window) {
  window.validate("CT window");
  const auto low = static_cast<float>(window.low_hu);
  const auto scale = static_cast<float>(1.0 / ((window.high_hu - window.low_hu) / kLargestByte));
  Volume<std::uint8_t> result;
  result.grid = hu.grid;
  result.voxels.resize(hu.voxels.size());
  parallel_ranges(hu.voxels.size(), [&](std::size_t begin, std::size_t end) {
    const float* from = hu.voxels.data();
    std::uint8_t* bytes = result.voxels.data();
    for (std::size_t i = begin; i < end; ++i) {
      const float level = (from[i] - low) * scale + 0.5F;
      bytes[i] = static_cast<std::uint8_t>(
          static_cast<std::int32_t>(std::min(std::max(level, 0.5F), kLargestByte + 0.5F)));
    }
  });
  return result;
}

PackedVoxels::PackedVoxels(Volume<std::uint8_t> bytes, const HuWindow& window)
    : bytes_(std::move(bytes)), window_(window) {
  const Eigen::Vector3i& size = bytes_.grid.size;
  bytes_.grid.validate("CT");
  window.validate("CT window");
  require(size.minCoeff() >= 2, "CT", "size", size.minCoeff(), ">= 2 along each axis");
  const std::size_t voxels = bytes_.grid.voxel_count();
  require(voxels <= kMostPackedVoxels, "CT in reach", "voxels", static_cast<double>(voxels),
          "<= 2^29: choose a level with a larger spacing");
  stride_j_ = static_cast<std::size_t>(size.x());
  stride_k_ = stride_j_ * static_cast<std::size_t>(size.y() - 1);
  pairs_.resize(stride_k_ * static_cast<std::size_t>(size.z()));
  parallel_for(size.z(), [&](int k) {
    // Rows lie behind each other, so that a slice is packed as one.
    const std::uint8_t* here = &bytes_.at(0, 0, k);
    const std::uint8_t* next = here + stride_j_;
    std::uint16_t* out = pairs_.data() + static_cast<std::size_t>(k) * stride_k_;
    const std::size_t count = stride_k_;
    for (std::size_t i = 0; i < count; ++i)
      out[i] = static_cast<std::uint16_t>(here[i] | next[i] << 8);
  });
}

const LargeVector<std::uint32_t>& PackedVoxels::with_gradient() const {
  std::call_once(gradient_made_, [&] {
    with_gradient_.resize(pairs_.size());
    parallel_for(bytes_.grid.size.z(), [&](int k) {
      write_with_gradient(bytes_, k, 1.0 / gradient_step_per_mm(),
                          with_gradient_.data() + static_cast<std::size_t>(k) * stride_k_);
    });
    has_gradient_ = true;
    std::vector<std::uint8_t>().swap(bytes_.voxels);  // all that they were needed for is made
  });
  return with_gradient_;
}

std::size_t PackedVoxels::memory() const {
  const std::size_t of_rest =
      has_gradient_ ? pairs_.size() * sizeof(std::uint32_t) : bytes_.grid.voxel_count();
  return pairs_.size() * sizeof(std::uint16_t) + of_rest;
}

}  // namespace usct
