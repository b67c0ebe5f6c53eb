#include "us_ct_registration/similarity/packed_ct.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "simulation/require.h"

namespace usct {
namespace {

constexpr double kLargestByte = 255.0;

std::vector<std::uint8_t> bytes_of(const Volume<float>& ct_hu, const HuWindow& window,
                                   double step_hu) {
  std::vector<std::uint8_t> bytes(ct_hu.voxels.size());
  const auto low = static_cast<float>(window.low_hu);
  const auto scale = static_cast<float>(1.0 / step_hu);
  const std::size_t slice = bytes.size() / static_cast<std::size_t>(ct_hu.grid.size.z());
  parallel_for(ct_hu.grid.size.z(), [&](int k) {
    for (std::size_t i = static_cast<std::size_t>(k) * slice, end = i + slice; i < end; ++i) {
      const float level = (ct_hu.voxels[i] - low) * scale + 0.5F;
      bytes[i] = static_cast<std::uint8_t>(
          std::clamp(level, 0.5F, static_cast<float>(kLargestByte) + 0.5F));
    }
  });
  return bytes;
}

}  // namespace

PackedCt::PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu)
    : grid_(ct_hu.grid) {
  grid_.validate("CT");
  window.validate("CT window");
  require(grid_.size.minCoeff() >= 2, "CT", "size", grid_.size.minCoeff(), ">= 2 along each axis");
  require(background_hu >= window.low_hu && background_hu <= window.high_hu, "CT", "background_hu",
          background_hu, "within the window");
  step_hu_ = (window.high_hu - window.low_hu) / kLargestByte;
  background_ = (background_hu - window.low_hu) / step_hu_;

  const std::vector<std::uint8_t> bytes = bytes_of(ct_hu, window, step_hu_);
  const Eigen::Vector3i cells = grid_.size - Eigen::Vector3i::Ones();
  stride_j_ = static_cast<std::size_t>(cells.x());
  stride_k_ = stride_j_ * static_cast<std::size_t>(cells.y());
  cells_.resize(stride_k_ * static_cast<std::size_t>(cells.z()));
  const auto row = static_cast<std::size_t>(grid_.size.x());
  const std::size_t slice = row * static_cast<std::size_t>(grid_.size.y());
  parallel_for(cells.z(), [&](int k) {
    for (int j = 0; j < cells.y(); ++j) {
      const std::uint8_t* corner = bytes.data() + grid_.offset(0, j, k);
      std::uint64_t* out = cells_.data() + static_cast<std::size_t>(k) * stride_k_ +
                           static_cast<std::size_t>(j) * stride_j_;
      // The four edges along i, each as two bytes: those of one voxel are the next one's lower.
      const auto column = [&](std::size_t i) {
        return static_cast<std::uint64_t>(corner[i]) |
               static_cast<std::uint64_t>(corner[i + row]) << 16 |
               static_cast<std::uint64_t>(corner[i + slice]) << 32 |
               static_cast<std::uint64_t>(corner[i + slice + row]) << 48;
      };
      std::uint64_t here = column(0);
      for (std::size_t i = 0; i < stride_j_; ++i) {
        const std::uint64_t next = column(i + 1);
        out[i] = here | next << 8;
        here = next;
      }
    }
  });
}

}  // namespace usct
