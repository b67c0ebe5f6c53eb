#include "registration/search/ultrasound_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace usct::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The samples of a beam that count, from the first to the last.
struct Known {
  std::size_t begin, end;
};

Known known_of(const BeamUltrasound& us, std::size_t beam) {
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  const std::uint8_t* const first = us.known.data() + beam * samples;
  Known known{0, samples};
  while (known.end > 0 && first[known.end - 1] == 0) --known.end;
  while (known.begin < known.end && first[known.begin] == 0) ++known.begin;
  return known;
}

/// The straight line along which the samples of a beam lie.
struct SampleLine {
  Vector3d first, step;
  Vector3d at(std::size_t sample) const { return first + static_cast<double>(sample) * step; }
};

SampleLine line_of(const BeamUltrasound& us, std::size_t beam, const Eigen::Affine3d& T) {
  const Beam& of = us.beams.beams[beam];
  const double first_mm = us.beams.axial.depth_mm(0.0);
  return {T * (of.origin_mm + first_mm * of.direction),
          T.linear() * ((us.beams.axial.depth_mm(1.0) - first_mm) * of.direction)};
}

/// The box around all samples that count, where T moves them.
Eigen::AlignedBox3d box_of(const BeamUltrasound& us, const Eigen::Affine3d& T) {
  Eigen::AlignedBox3d box;
  for (std::size_t beam = 0; beam < us.beams.beams.size(); ++beam) {
    const Known known = known_of(us, beam);
    if (known.begin == known.end) continue;
    const SampleLine line = line_of(us, beam, T);
    box.extend(line.at(known.begin));
    box.extend(line.at(known.end - 1));
  }
  return box;
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
  constexpr float kMost = kMostOfCell - 0.5F;
  float sum = 0.0F;
  int written = 0;
  int squares = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += kMost / most * deviation(i);
    const int cell = static_cast<int>(std::floor(sum + 0.5F)) - written;
    written += cell;
    squares += cell * cell;
    block.cells[i] = static_cast<std::int8_t>(cell);
  }
  block.norm = std::sqrt(static_cast<float>(squares));
  return block;
}

}  // namespace

double diagonal_mm(const BeamUltrasound& us) {
  const Eigen::AlignedBox3d box = box_of(us, Eigen::Affine3d::Identity());
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

UltrasoundCells::UltrasoundCells(const BeamUltrasound& us, const Eigen::Isometry3d& mirror,
                                 double edge_mm)
    : edge_mm_(edge_mm) {
  // Rounding moves no sample out of the lattice.
  constexpr double kMarginMm = 1e-9;
  const Eigen::AlignedBox3d box = box_of(us, mirror);
  if (box.isEmpty()) return;
  origin_us_mm_ = box.min() - Vector3d::Constant(kMarginMm);
  const Vector3d extent_mm = box.max() - origin_us_mm_ + Vector3d::Constant(kMarginMm);
  size_ = (extent_mm / edge_mm_).cast<int>() + Vector3i::Ones();
  cells_.resize(size_.cast<std::size_t>().prod());
  const Eigen::Affine3d T_cells_us =
      Eigen::Scaling(1.0 / edge_mm_) *
      (Eigen::Translation3d(-origin_us_mm_) * Eigen::Affine3d(mirror));
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  for (std::size_t beam = 0; beam < us.beams.beams.size(); ++beam) {
    const SampleLine line = line_of(us, beam, T_cells_us);
    const Known known = known_of(us, beam);
    for (std::size_t s = known.begin; s < known.end; ++s) {
      const std::size_t sample = beam * samples + s;
      if (us.known[sample] == 0) continue;
      Cell& cell = cells_[place(line.at(s).cast<int>())];
      cell.sum += us.brightness[sample];
      cell.count += 1.0F;
    }
  }
}

std::size_t UltrasoundCells::known() const {
  return static_cast<std::size_t>(std::count_if(
      cells_.begin(), cells_.end(), [](const Cell& cell) { return cell.count > 0.0F; }));
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
