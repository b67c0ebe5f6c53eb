#include "registration/images/reached_average.h"

#include <utility>

namespace usct {
namespace {

using Eigen::Vector3i;

bool holds(const Region& region, const Region& other) {
  return (other.begin - region.begin).minCoeff() >= 0 &&
         (region.begin + region.size - other.begin - other.size).minCoeff() >= 0;
}

double volume(const Region& region) { return region.size.cast<double>().prod(); }

/// The smallest region around both.
Region around(const Region& a, const Region& b) {
  const Vector3i begin = a.begin.cwiseMin(b.begin);
  return {begin, (a.begin + a.size).cwiseMax(b.begin + b.size) - begin};
}

/// The region, enlarged to whole cubes, so that registrations which reach a little beyond each
/// other share a part.
Region in_cubes(const Region& region, const Vector3i& size) {
  constexpr int kCube = 8;
  const Vector3i begin = region.begin / kCube * kCube;
  const Vector3i end = (region.begin + region.size + Vector3i::Constant(kCube - 1)) / kCube * kCube;
  return {begin, end.cwiseMin(size) - begin};
}

}  // namespace

ReachedAverage::ReachedAverage(const HuWindow& window, std::vector<Vector3i> steps,
                               Volume<std::uint8_t> bytes)
    : window_(window), steps_(std::move(steps)), bytes_(std::move(bytes)) {}

bool ReachedAverage::is_for(const HuWindow& window, const std::vector<Vector3i>& steps) const {
  return window_.low_hu == window.low_hu && window_.high_hu == window.high_hu && steps_ == steps;
}

PackedPart ReachedAverage::over(const Region& region) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!packed_ || !holds(kept_, region)) {
    // The part from before is kept too, unless both together are far larger than the region.
    constexpr double kMost = 1.5;
    const Region wanted = in_cubes(region, bytes_.grid.size);
    const Region both = packed_ ? around(kept_, wanted) : wanted;
    const Region next = volume(both) <= kMost * volume(wanted) ? both : wanted;
    packed_ = std::make_shared<const PackedVoxels>(crop(bytes_, next), window_);
    kept_ = next;  // not before: if memory runs out, the part from before stays
  }
  return {packed_, kept_.begin};
}

std::size_t ReachedAverage::memory() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return bytes_.voxels.size() + (packed_ ? packed_->memory() : 0);
}

}  // namespace usct
