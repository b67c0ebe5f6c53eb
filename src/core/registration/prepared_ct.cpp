#include "us_ct_registration/registration/prepared_ct.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "registration/as_patient.h"
#include "registration/evidence_plan.h"
#include "registration/images/ct_averages.h"
#include "registration/images/reached_average.h"

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
    take(averaged(ct, {steps}, {part}).front());
  }
}

using Averages = std::vector<std::unique_ptr<const ReachedAverage>>;

const ReachedAverage* found_in(const Averages& averages, const HuWindow& window,
                               const AveragingSteps& steps) {
  const auto found = std::find_if(averages.begin(), averages.end(), [&](const auto& average) {
    return average->is_for(window, steps);
  });
  return found == averages.end() ? nullptr : found->get();
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
      average_in_parts(ct, steps[i], check, [&](const Volume<float>& part) {
        average.voxels.insert(average.voxels.end(), part.voxels.begin(), part.voxels.end());
      });
    else
      average.voxels = shrink(finer, steps[i].back(), whole(finer.grid)).voxels;
    averages.push_back(std::make_unique<const ReachedAverage>(options.window, steps[i],
                                                              in_bytes(average, options.window)));
    finer = std::move(average);
  }
}

/// In bytes, part by part.
Volume<std::uint8_t> refinement_average(const CtVolume& ct, const AveragingSteps& steps,
                                        const HuWindow& window, const Check& check) {
  Volume<std::uint8_t> bytes;
  bytes.grid = averaged_grid(ct.grid, steps);
  bytes.voxels.reserve(bytes.grid.voxel_count());
  average_in_parts(ct, steps, check, [&](const Volume<float>& part) {
    const Volume<std::uint8_t> converted = in_bytes(part, window);
    bytes.voxels.insert(bytes.voxels.end(), converted.voxels.begin(), converted.voxels.end());
  });
  return bytes;
}

/// The averages that a registration by these options looks at, as far as they are not there.
void prepare(const CtVolume& ct, const RegistrationOptions& options, const Check& check,
             Averages& averages) {
  prepare_levels(ct, options, check, averages);
  const std::optional<RefinementOptions>& refinement = options.refinement;
  if (!refinement || needs_of(refinement->similarity).recorded_ct) return;
  const AveragingSteps steps = steps_to(refinement->spacing_mm, ct.grid);
  if (found_in(averages, options.window, steps) == nullptr)
    averages.push_back(std::make_unique<const ReachedAverage>(
        options.window, steps, refinement_average(ct, steps, options.window, check)));
}

}  // namespace

std::uint64_t PreparedCt::next_number() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

PreparedCt::PreparedCt(const CtVolume& ct) : ct_(ct) {}

PreparedCt::PreparedCt(const CtVolume& ct, const RegistrationOptions& options, const Check& check)
    : ct_(ct) {
  ct.validate("CT");
  options.validate();
  prepare(ct, options, check, averages_);
  if (EvidencePlan(options.confidence).may_need_patient())
    prepare(ct, as_patient(options), check, averages_);
}

PreparedCt::~PreparedCt() = default;

const ReachedAverage* PreparedCt::find(const HuWindow& window,
                                       const std::vector<Eigen::Vector3i>& steps) const {
  return found_in(averages_, window, steps);
}

std::size_t PreparedCt::bytes() const {
  return std::accumulate(
      averages_.begin(), averages_.end(), std::size_t{0},
      [](std::size_t sum, const auto& average) { return sum + average->memory(); });
}

}  // namespace usct
