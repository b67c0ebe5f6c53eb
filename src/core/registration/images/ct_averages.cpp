#include "registration/images/ct_averages.h"

#include <algorithm>
#include <cmath>

#include "registration/images/reached_average.h"

namespace usct::registration {
namespace {

using Eigen::Vector3i;

/// Fewest voxels of a PackedCt along each axis.
constexpr int kLeast = 2;

/// Numbers of voxels whose mean has about the spacing; two means at least remain along each axis.
Vector3i factors_to(const std::optional<double>& spacing_mm, const Grid& grid) {
  Vector3i factors = Vector3i::Ones();
  if (!spacing_mm) return factors;
  for (int axis = 0; axis < 3; ++axis)
    factors[axis] = std::clamp(static_cast<int>(std::lround(*spacing_mm / grid.spacing_mm[axis])),
                               1, std::max(1, grid.size[axis] / kLeast));
  return factors;
}

/// Voxels of the CT in one of an average.
Vector3i block_of(const AveragingSteps& steps) {
  Vector3i block = Vector3i::Ones();
  for (const Vector3i& step : steps) block = block.cwiseProduct(step);
  return block;
}

/// The region of an average that covers a region of the CT, as far as the average goes.
Region blocks_over(const Region& region, const AveragingSteps& steps, const Grid& ct) {
  const Vector3i block = block_of(steps);
  const Vector3i size = averaged_grid(ct, steps).size;
  const Vector3i last = region.begin + region.size + block - Vector3i::Ones();
  const Vector3i begin =
      region.begin.cwiseQuotient(block).cwiseMin(size - Vector3i::Constant(kLeast));
  const Vector3i end =
      last.cwiseQuotient(block).cwiseMin(size).cwiseMax(begin + Vector3i::Constant(kLeast));
  return {begin, end - begin};
}

/// A region with the voxels around it, as far as there are any.
Region with_neighbours(const Region& region, const Vector3i& size) {
  const Vector3i one = Vector3i::Ones();
  const Vector3i begin = (region.begin - one).cwiseMax(0);
  return {begin, (region.begin + region.size + one).cwiseMin(size) - begin};
}

/// The region of a grid of so many voxels whose voxels have all their neighbours in another region,
/// as far as there are any.
Region without_outermost(const Region& region, const Vector3i& size) {
  Region inner = region;
  for (int axis = 0; axis < 3; ++axis) {
    const int before = region.begin[axis] > 0 ? 1 : 0;
    const int after = region.begin[axis] + region.size[axis] < size[axis] ? 1 : 0;
    inner.begin[axis] += before;
    inner.size[axis] -= before + after;
  }
  return inner;
}

/// The region of the finer average that a region of a coarser one is made of. The Gaussian over a
/// block of `step` voxels reaches that many beyond it on either side.
Region made_of(const Region& coarse, const Vector3i& step, const Vector3i& finer_size) {
  const Vector3i one = Vector3i::Ones();
  const Vector3i begin = (coarse.begin - one).cwiseProduct(step).cwiseMax(Vector3i::Zero());
  const Vector3i end = (coarse.begin + coarse.size + one).cwiseProduct(step).cwiseMin(finer_size);
  return {begin, end - begin};
}

}  // namespace

AveragingSteps steps_to(const std::optional<double>& spacing_mm, const Grid& ct) {
  return {factors_to(spacing_mm, ct)};
}

std::vector<AveragingSteps> steps_of(const std::vector<LevelOptions>& levels, const Grid& ct) {
  std::vector<AveragingSteps> all(levels.size());
  AveragingSteps steps;
  for (std::size_t i = levels.size(); i-- > 0;) {
    if (needs_of(levels[i].similarity).recorded_ct) continue;
    steps.push_back(factors_to(levels[i].spacing_mm, averaged_grid(ct, steps)));
    all[i] = steps;
  }
  return all;
}

Grid averaged_grid(const Grid& ct, const AveragingSteps& steps) {
  Grid grid = ct;
  for (const Vector3i& step : steps) grid = shrunk_grid(grid, step, whole(grid));
  return grid;
}

std::vector<Region> regions_over(const Region& region, const std::vector<AveragingSteps>& steps,
                                 const Grid& ct) {
  std::vector<Region> regions(steps.size());
  std::optional<std::size_t> coarser;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].empty()) continue;
    regions[i] =
        coarser
            ? made_of(regions[*coarser], steps[*coarser].back(), averaged_grid(ct, steps[i]).size)
            : with_neighbours(blocks_over(region, steps[i], ct), averaged_grid(ct, steps[i]).size);
    coarser = i;
  }
  return regions;
}

std::vector<Volume<float>> averaged(const CtVolume& ct, const std::vector<AveragingSteps>& steps,
                                    const std::vector<Region>& regions, const Check& check) {
  std::vector<Volume<float>> averages(steps.size());
  std::optional<std::size_t> finer;
  for (std::size_t i = steps.size(); i-- > 0;) {
    if (steps[i].empty()) continue;
    if (check) check();
    const Vector3i& step = steps[i].back();
    const Region block{regions[i].begin.cwiseProduct(step), regions[i].size.cwiseProduct(step)};
    averages[i] =
        finer ? shrink(averages[*finer], step, {block.begin - regions[*finer].begin, block.size})
              : shrink(ct, step, block);
    // This is the arithmetic of a region that is cut out, so that the bits are the same.
    averages[i].grid = region_grid(averaged_grid(ct.grid, steps[i]), regions[i]);
    finer = i;
  }
  return averages;
}

std::vector<std::shared_ptr<const PackedCt>> packed_cts(const PreparedCt& ct, const Region& region,
                                                        const std::vector<AveragingSteps>& steps,
                                                        const RegistrationOptions& options,
                                                        const Check& check) {
  const Grid& ct_grid = ct.ct().grid;
  const std::vector<Region> regions = regions_over(region, steps, ct_grid);
  std::vector<const ReachedAverage*> prepared(steps.size());
  bool are_all_prepared = true;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].empty()) continue;
    prepared[i] = ct.find(options.window, steps[i]);
    are_all_prepared = are_all_prepared && prepared[i] != nullptr;
  }
  const std::vector<Volume<float>> averages = are_all_prepared
                                                  ? std::vector<Volume<float>>(steps.size())
                                                  : averaged(ct.ct(), steps, regions, check);
  std::vector<std::shared_ptr<const PackedCt>> packed(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].empty()) continue;
    // Gradients at the ends of the region then are those of the whole CT.
    const Grid grid = averaged_grid(ct_grid, steps[i]);
    const Region inner = without_outermost(regions[i], grid.size);
    const PackedPart part =
        are_all_prepared ? prepared[i]->over(regions[i])
                         : PackedPart{std::make_shared<const PackedVoxels>(
                                          in_bytes(averages[i], options.window), options.window),
                                      regions[i].begin};
    packed[i] = std::make_shared<const PackedCt>(part.voxels, inner.begin - part.begin,
                                                 region_grid(grid, inner), options.outside_hu);
  }
  return packed;
}

}  // namespace usct::registration
