#include "similarity/packed_ct.h"

#include <sstream>

#include "require.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

std::size_t place_of(const Eigen::Vector3i& voxel, const PackedVoxels& voxels) {
  return static_cast<std::size_t>(voxel.x()) +
         static_cast<std::size_t>(voxel.y()) * voxels.stride_j() +
         static_cast<std::size_t>(voxel.z()) * voxels.stride_k();
}

void require_within(const Eigen::Vector3i& begin, const Eigen::Vector3i& size,
                    const Eigen::Vector3i& available) {
  if (begin.minCoeff() >= 0 && (available - begin - size).minCoeff() >= 0) return;
  std::ostringstream violation;
  violation << "the region of " << size.transpose() << " voxels from " << begin.transpose()
            << " on must lie within " << available.transpose();
  throw InputError("CT", violation.str());
}

}  // namespace

PackedCt::PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu)
    : PackedCt(std::make_shared<const PackedVoxels>(in_bytes(ct_hu, window), window),
               Eigen::Vector3i::Zero(), ct_hu.grid, background_hu) {}

PackedCt::PackedCt(std::shared_ptr<const PackedVoxels> voxels, const Eigen::Vector3i& begin,
                   Grid grid, double background_hu)
    : voxels_(std::move(voxels)), grid_(std::move(grid)) {
  const HuWindow& window = voxels_->window();
  require_within(begin, grid_.size, voxels_->grid().size);
  require(grid_.size.minCoeff() >= 2, "CT", "size", grid_.size.minCoeff(), ">= 2 along each axis");
  require(background_hu >= window.low_hu && background_hu <= window.high_hu, "CT", "background_hu",
          background_hu, "within the window");
  step_hu_ = (window.high_hu - window.low_hu) / kLargestByte;
  background_ = (background_hu - window.low_hu) / step_hu_;
  pairs_ = voxels_->pairs().data() + place_of(begin, *voxels_);
}

PackedGradient PackedCt::gradient() const {
  return {voxels_->with_gradient().data() + (pairs_ - voxels_->pairs().data()),
          voxels_->gradient_step_per_mm()};
}

}  // namespace usct
