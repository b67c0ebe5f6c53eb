#include "registration/search/ultrasound_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace usct::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Calls use(position in the US frame, brightness) for all samples that count.
template <typename Use>
void for_known(const BeamUltrasound& us, const Eigen::Isometry3d& mirror, const Use& use) {
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  for (std::size_t b = 0; b < us.beams.beams.size(); ++b) {
    const Beam& beam = us.beams.beams[b];
    for (std::size_t s = 0; s < samples; ++s) {
      if (us.known[b * samples + s] == 0) continue;
      const double depth_mm = us.beams.axial.depth_mm(static_cast<double>(s));
      const Vector3d at_us_mm = mirror * (beam.origin_mm + depth_mm * beam.direction);
      use(at_us_mm, us.brightness[b * samples + s]);
    }
  }
}

/// Nothing if less than half of the cells are known, or they do not vary.
std::optional<BlockUltrasound> normalised(const std::array<float, kBlockCells>& values,
                                          const std::array<bool, kBlockCells>& known) {
  BlockUltrasound block;
  block.known = static_cast<float>(std::count(known.begin(), known.end(), true));
  if (block.known < 0.5F * kBlockCells) return std::nullopt;
  float mean = 0.0F;
  for (const float value : values) mean += value / block.known;
  const auto deviation = [&](std::size_t i) { return known[i] ? values[i] - mean : 0.0F; };
  float most = 0.0F;
  for (std::size_t i = 0; i < values.size(); ++i) most = std::max(most, std::abs(deviation(i)));
  // Rounding leaves no deviation of less than this to constant ultrasound.
  if (!(most > 1e-3F * std::abs(mean)) || !(most > 0.0F)) return std::nullopt;
  // Sums are rounded in place of cells, so that the sum of all is 0, and each is off by less
  // than 1.
  constexpr float kMost = std::numeric_limits<std::int8_t>::max();
  float sum = 0.0F;
  int written = 0;
  int squares = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += kMost / most * deviation(i);
    const int cell = static_cast<int>(std::lround(sum)) - written;
    written += cell;
    squares += cell * cell;
    block.cells[i] = static_cast<std::int8_t>(cell);
  }
  block.norm = std::sqrt(static_cast<float>(squares));
  return block;
}

}  // namespace

UltrasoundCells::UltrasoundCells(const BeamUltrasound& us, const Eigen::Isometry3d& mirror) {
  Eigen::AlignedBox3d box;
  for_known(us, mirror, [&](const Vector3d& at_us_mm, float) { box.extend(at_us_mm); });
  if (box.isEmpty()) return;
  origin_us_mm_ = box.min();
  size_ = (box.sizes() / kMm).array().floor().cast<int>() + 1;
  cells_.resize(static_cast<std::size_t>(size_.prod()));
  for_known(us, mirror, [&](const Vector3d& at_us_mm, float brightness) {
    const Vector3i cell = ((at_us_mm - origin_us_mm_) / kMm).array().floor().cast<int>();
    cells_[place(cell)].sum += brightness;
    cells_[place(cell)].count += 1.0F;
  });
}

std::optional<UltrasoundBlock> UltrasoundCells::block_at(const Vector3i& first) const {
  UltrasoundBlock block;
  block.first = first;
  std::array<float, kBlockCells> values{};
  std::array<bool, kBlockCells> known{};
  Vector3d sum_mm = Vector3d::Zero();
  std::size_t i = 0;
  for (int z = 0; z < kBlockEdge; ++z)
    for (int y = 0; y < kBlockEdge; ++y)
      for (int x = 0; x < kBlockEdge; ++x, ++i) {
        const Vector3i cell = first + Vector3i(x, y, z);
        known[i] = is_known(cell);
        if (!known[i]) continue;
        values[i] = cells_[place(cell)].sum / cells_[place(cell)].count;
        sum_mm += middle_us_mm(cell.cast<double>());
      }
  const std::optional<BlockUltrasound> ultrasound = normalised(values, known);
  if (!ultrasound) return std::nullopt;
  block.ultrasound = *ultrasound;
  block.middle_us_mm = sum_mm / static_cast<double>(ultrasound->known);
  return block;
}

std::vector<UltrasoundBlock> UltrasoundCells::blocks() const {
  std::vector<UltrasoundBlock> blocks;
  for (int z = 0; z < size_.z(); z += kBlockEdge)
    for (int y = 0; y < size_.y(); y += kBlockEdge)
      for (int x = 0; x < size_.x(); x += kBlockEdge)
        if (const std::optional<UltrasoundBlock> block = block_at({x, y, z}))
          blocks.push_back(*block);
  return blocks;
}

}  // namespace usct::registration
