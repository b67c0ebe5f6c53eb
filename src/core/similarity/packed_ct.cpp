#include "similarity/packed_ct.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "require.h"
#include "similarity/packed_gradient.h"

namespace usct {

BytesOfCt::BytesOfCt(const HuWindow& window) {
  window.validate("CT window");
  low_ = static_cast<float>(window.low_hu);
  scale_ = static_cast<float>(1.0 / ((window.high_hu - window.low_hu) / kLargestByte));
}

void BytesOfCt::operator()(const float* hu, std::size_t count, std::uint8_t* bytes) const {
  for (std::size_t i = 0; i < count; ++i) {
    const float level = (hu[i] - low_) * scale_ + 0.5F;
    bytes[i] = static_cast<std::uint8_t>(
        static_cast<std::int32_t>(std::min(std::max(level, 0.5F), kLargestByte + 0.5F)));
  }
}

PackedCt::PackedCt(Grid grid, const HuWindow& window, double background_hu)
    : grid_(std::move(grid)) {
  grid_.validate("CT");
  window.validate("CT window");
  require(grid_.size.minCoeff() >= 2, "CT", "size", grid_.size.minCoeff(), ">= 2 along each axis");
  require(background_hu >= window.low_hu && background_hu <= window.high_hu, "CT", "background_hu",
          background_hu, "within the window");
  step_hu_ = (window.high_hu - window.low_hu) / kLargestByte;
  background_ = (background_hu - window.low_hu) / step_hu_;
  stride_j_ = static_cast<std::size_t>(grid_.size.x());
  stride_k_ = stride_j_ * static_cast<std::size_t>(grid_.size.y() - 1);
  pairs_.resize(stride_k_ * static_cast<std::size_t>(grid_.size.z()));
}

PackedCt::PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu)
    : PackedCt(ct_hu.grid, window, background_hu) {
  const BytesOfCt bytes_of(window);
  pack([&](int j, int k, std::vector<std::uint8_t>& bytes) {
    bytes_of(&ct_hu.at(0, j, k), bytes.size(), bytes.data());
  });
}

PackedCt::PackedCt(const Volume<std::uint8_t>& volume, const Region& region, const HuWindow& window,
                   double background_hu)
    : PackedCt(region_grid(volume.grid, region), window, background_hu) {
  const Eigen::Vector3i& begin = region.begin;
  pack([&](int j, int k, std::vector<std::uint8_t>& bytes) {
    std::copy_n(&volume.at(begin.x(), begin.y() + j, begin.z() + k), bytes.size(), bytes.data());
  });
}

template <typename RowBytes>
void PackedCt::pack(const RowBytes& row_bytes) {
  parallel_for(grid_.size.z(), [&](int k) {
    std::uint16_t* out = pairs_.data() + static_cast<std::size_t>(k) * stride_k_;
    std::vector<std::uint8_t> here(stride_j_);
    std::vector<std::uint8_t> next(stride_j_);
    row_bytes(0, k, here);
    for (int j = 1; j < grid_.size.y(); ++j, out += stride_j_) {
      row_bytes(j, k, next);
      for (std::size_t i = 0; i < stride_j_; ++i)
        out[i] = static_cast<std::uint16_t>(here[i] | next[i] << 8);
      here.swap(next);
    }
  });
}

const PackedGradient& PackedCt::gradient() const {
  std::call_once(gradient_made_,
                 [&] { gradient_ = std::make_unique<const PackedGradient>(with_gradient(*this)); });
  return *gradient_;
}

}  // namespace usct
