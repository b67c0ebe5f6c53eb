#include "us_ct_registration/registration/prepared_ct.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "parallel.h"
#include "registration/as_patient.h"
#include "registration/ct_averages.h"

namespace usct {
namespace {

using namespace registration;

/// Slices of an average that are made between two checks.
constexpr int kSlices = 16;

/// Averages the whole CT by one step, and gives the parts of the result in their order to `take`.
template <typename Take>
void average_in_parts(const CtVolume& ct, const AveragingSteps& steps, const Check& check,
                      const Take& take) {
  const Grid grid = averaged_grid(ct.grid, steps);
  for (int begin = 0; begin < grid.size.z(); begin += kSlices) {
    if (check) check();
    Region part = whole(grid);
    part.begin.z() = begin;
    part.size.z() = std::min(kSlices, grid.size.z() - begin);
    take(averaged(ct, {steps}, {part}).front().voxels);
  }
}

std::vector<std::uint8_t> in_bytes(const std::vector<float>& hu, const HuWindow& window) {
  const BytesOfCt bytes_of(window);
  std::vector<std::uint8_t> bytes(hu.size());
  parallel_ranges(hu.size(), [&](std::size_t begin, std::size_t end) {
    bytes_of(hu.data() + begin, end - begin, bytes.data() + begin);
  });
  return bytes;
}

bool is_same(const HuWindow& a, const HuWindow& b) {
  return a.low_hu == b.low_hu && a.high_hu == b.high_hu;
}

using Averages = std::vector<PreparedCt::Average>;

const PreparedCt::Average* found_in(const Averages& averages, const HuWindow& window,
                                    const AveragingSteps& steps) {
  const auto found =
      std::find_if(averages.begin(), averages.end(), [&](const PreparedCt::Average& average) {
        return is_same(average.window, window) && average.steps == steps;
      });
  return found == averages.end() ? nullptr : &*found;
}

/// The averages of the search's levels, coarse ones from fine ones.
void prepare_levels(const CtVolume& ct, const RegistrationOptions& options, const Check& check,
                    Averages& averages) {
  const std::vector<AveragingSteps> steps = steps_of(options.search.levels, ct.grid);
  if (std::all_of(steps.begin(), steps.end(), [&](const AveragingSteps& level) {
        return level.empty() || found_in(averages, options.window, level) != nullptr;
      }))
    return;
  Volume<float> finer;
  for (std::size_t i = steps.size(); i-- > 0;) {
    if (steps[i].empty()) continue;
    Volume<float> average;
    average.grid = averaged_grid(ct.grid, steps[i]);
    if (finer.voxels.empty())
      average_in_parts(ct, steps[i], check, [&](const std::vector<float>& part) {
        average.voxels.insert(average.voxels.end(), part.begin(), part.end());
      });
    else
      average.voxels = shrink(finer, steps[i].back(), whole(finer.grid)).voxels;
    averages.push_back({options.window, steps[i], {}});
    averages.back().bytes.grid = average.grid;
    averages.back().bytes.voxels = in_bytes(average.voxels, options.window);
    finer = std::move(average);
  }
}

PreparedCt::Average refinement_average(const CtVolume& ct, const AveragingSteps& steps,
                                       const HuWindow& window, const Check& check) {
  PreparedCt::Average average{window, steps, {}};
  Volume<std::uint8_t>& bytes = average.bytes;
  bytes.grid = averaged_grid(ct.grid, steps);
  bytes.voxels.reserve(bytes.grid.voxel_count());
  average_in_parts(ct, steps, check, [&](const std::vector<float>& part) {
    const std::vector<std::uint8_t> converted = in_bytes(part, window);
    bytes.voxels.insert(bytes.voxels.end(), converted.begin(), converted.end());
  });
  return average;
}

/// The averages that a registration by these options looks at, as far as they are not there.
void prepare(const CtVolume& ct, const RegistrationOptions& options, const Check& check,
             Averages& averages) {
  prepare_levels(ct, options, check, averages);
  const std::optional<RefinementOptions>& refinement = options.refinement;
  if (!refinement || needs_of(refinement->similarity).recorded_ct) return;
  const AveragingSteps steps = steps_to(refinement->spacing_mm, ct.grid);
  if (found_in(averages, options.window, steps) == nullptr)
    averages.push_back(refinement_average(ct, steps, options.window, check));
}

}  // namespace

std::uint64_t PreparedCt::next_number() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

PreparedCt::PreparedCt(const CtVolume& ct, const RegistrationOptions& options, const Check& check)
    : ct_(ct) {
  ct.validate("CT");
  options.validate();
  prepare(ct, options, check, averages_);
  if (options.confidence.evidence != EvidenceSource::kOwn)
    prepare(ct, as_patient(options), check, averages_);
}

const Volume<std::uint8_t>* PreparedCt::find(const HuWindow& window,
                                             const std::vector<Eigen::Vector3i>& steps) const {
  const Average* found = found_in(averages_, window, steps);
  return found == nullptr ? nullptr : &found->bytes;
}

std::size_t PreparedCt::bytes() const {
  return std::accumulate(
      averages_.begin(), averages_.end(), std::size_t{0},
      [](std::size_t sum, const Average& average) { return sum + average.bytes.voxels.size(); });
}

}  // namespace usct
