#include "phantom/tissue_raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "parallel.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Air closer than this to the array's middle is filled with gel.
constexpr double kCouplingMm = 60.0;
constexpr double kStepMm = 2.0;

Vector3i block_of(const Vector3d& p_ct_mm) {
  return (p_ct_mm / TissueRaster::kBlockMm).array().floor().cast<int>();
}

/// Calls `visit(block)` for points throughout the beams.
template <typename Visit>
void visit_beams(const ScannedBody& body, const BeamGrid& beams, const Visit& visit) {
  const double length_mm = beams.axial.depth_mm(beams.samples() - 1) - beams.axial.start_depth_mm;
  const int steps = static_cast<int>(std::ceil(length_mm / kStepMm)) + 1;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; l += (l + 2 < beams.lines || l + 1 == beams.lines) ? 2 : 1)
      for (int step = 0; step < steps; ++step) {
        const double d = beams.axial.start_depth_mm + step * kStepMm;
        const Beam& beam = beams.beam(f, l);
        visit(block_of(body.placement().ct_from_probe(beam.origin_mm + d * beam.direction)));
      }
}

/// Distance of a block from the beams.
enum Mark : std::uint8_t { kFarOff, kNextButOne, kNext, kPassed };

/// The blocks of the lattice around the beams, each with its mark.
struct MarkedBlocks {
  Vector3i low;
  Vector3i count;
  std::vector<std::uint8_t> marks;

  std::size_t index(const Vector3i& block) const {
    return (static_cast<std::size_t>(block.z()) * static_cast<std::size_t>(count.y()) +
            static_cast<std::size_t>(block.y())) *
               static_cast<std::size_t>(count.x()) +
           static_cast<std::size_t>(block.x());
  }

  /// Marks the neighbours of blocks with the mark `from` as one step farther.
  void spread(std::uint8_t from) {
    const std::vector<std::uint8_t> before = marks;
    for (int k = 1; k + 1 < count.z(); ++k)
      for (int j = 1; j + 1 < count.y(); ++j)
        for (int i = 1; i + 1 < count.x(); ++i) {
          if (before[index({i, j, k})] != from) continue;
          for (int n = 0; n < 27; ++n) {
            std::uint8_t& m = marks[index({i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1})];
            m = std::max<std::uint8_t>(m, static_cast<std::uint8_t>(from - 1));
          }
        }
  }
};

MarkedBlocks mark_blocks(const ScannedBody& body, const BeamGrid& beams) {
  Vector3i low = Vector3i::Constant(std::numeric_limits<int>::max());
  Vector3i high = Vector3i::Constant(std::numeric_limits<int>::min());
  visit_beams(body, beams, [&](const Vector3i& block) {
    low = low.cwiseMin(block);
    high = high.cwiseMax(block);
  });
  // One block around covers beams of finite width, one more the neighbouring nodes.
  low.array() -= 2;
  MarkedBlocks blocks{low, high - low + Vector3i::Constant(3), {}};
  blocks.marks.assign(static_cast<std::size_t>(blocks.count.x()) *
                          static_cast<std::size_t>(blocks.count.y()) *
                          static_cast<std::size_t>(blocks.count.z()),
                      kFarOff);
  visit_beams(body, beams,
              [&](const Vector3i& block) { blocks.marks[blocks.index(block - low)] = kPassed; });
  blocks.spread(kPassed);
  blocks.spread(kNext);
  return blocks;
}

}  // namespace

ScannedBody::ScannedBody(const Scene& scene, const Placement& placement,
                         std::vector<Vector3d> apices_probe_mm)
    : scene_(scene), placement_(placement), apices_probe_mm_(std::move(apices_probe_mm)) {}

Tissue ScannedBody::tissue(const Vector3d& p_ct_mm) const {
  const Tissue tissue = scene_.anatomy->tissue(p_ct_mm);
  if (tissue != Tissue::kAir) return tissue;
  const Vector3d p = placement_.probe_from_ct(p_ct_mm);
  for (const Vector3d& apex : apices_probe_mm_)
    if ((p - apex).squaredNorm() < kCouplingMm * kCouplingMm) return Tissue::kGel;
  return tissue;
}

TissueRaster::TissueRaster(const ScannedBody& body, const BeamGrid& beams,
                           const Progress& progress) {
  const MarkedBlocks marked = mark_blocks(body, beams);
  const Vector3i& count = marked.count;
  first_ = marked.low * kBlock;
  size_ = count * kBlock;
  tissue_.assign(marked.marks.size() * kBlock * kBlock * kBlock,
                 static_cast<std::uint8_t>(Tissue::kGel));
  std::vector<Vector3i> evaluated;
  for (int k = 0; k < count.z(); ++k)
    for (int j = 0; j < count.y(); ++j)
      for (int i = 0; i < count.x(); ++i) {
        const std::uint8_t mark = marked.marks[marked.index({i, j, k})];
        const Vector3i first = (marked.low + Vector3i(i, j, k)) * kBlock;
        if (mark >= kNextButOne) evaluated.push_back(first);
        if (mark >= kNext) blocks_.push_back(first);
      }
  parallel_for(
      static_cast<int>(evaluated.size()),
      [&](int b) {
        const Vector3i first = evaluated[static_cast<std::size_t>(b)];
        for (int k = 0; k < kBlock; ++k)
          for (int j = 0; j < kBlock; ++j)
            for (int i = 0; i < kBlock; ++i) {
              const Vector3i n = first + Vector3i(i, j, k);
              tissue_[offset(n)] =
                  static_cast<std::uint8_t>(body.tissue(kPitchMm * n.cast<double>()));
            }
      },
      progress);
}

Tissue TissueRaster::nearest(const Vector3d& p_ct_mm) const {
  const Vector3i n = (p_ct_mm / kPitchMm).array().round().cast<int>();
  const Vector3i local = n - first_;
  if ((local.array() < 0).any() || (local.array() >= size_.array()).any()) return Tissue::kGel;
  return node(n);
}

}  // namespace usct::phantom
