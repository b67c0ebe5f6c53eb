#include "evaluation/bright_components.h"

namespace usct::evaluation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

class ComponentSearch {
 public:
  ComponentSearch(const CtVolume& ct, double threshold_hu, const Vector3d& largest_mm)
      : ct_(ct),
        seen_(ct.voxels.size(), false),
        threshold_(threshold_hu),
        largest_mm_(largest_mm) {}

  std::vector<Component> search() {
    std::vector<Component> found;
    for_each_voxel(whole(ct_.grid), [&](const Vector3i& start) {
      if (!is_new(start)) return;
      const Component component = grow(start);
      if ((component.extent_mm(ct_.grid).array() <= largest_mm_.array()).all())
        found.push_back(component);
    });
    return found;
  }

 private:
  std::size_t offset(const Vector3i& v) const { return ct_.grid.offset(v.x(), v.y(), v.z()); }
  bool is_new(const Vector3i& v) const {
    return !seen_[offset(v)] && ct_.voxels[offset(v)] >= threshold_;
  }

  Component grow(const Vector3i& start) {
    Component component{start, start, {start}};
    seen_[offset(start)] = true;
    for (std::size_t next = 0; next < component.voxels.size(); ++next) {
      const Vector3i v = component.voxels[next];
      component.first = component.first.cwiseMin(v);
      component.last = component.last.cwiseMax(v);
      const Vector3i begin = (v - Vector3i::Ones()).cwiseMax(Vector3i::Zero());
      const Vector3i end = (v + 2 * Vector3i::Ones()).cwiseMin(ct_.grid.size);
      for_each_voxel({begin, end - begin}, [&](const Vector3i& neighbour) {
        if (!is_new(neighbour)) return;
        seen_[offset(neighbour)] = true;
        component.voxels.push_back(neighbour);
      });
    }
    return component;
  }

  const CtVolume& ct_;
  std::vector<bool> seen_;
  double threshold_;
  Vector3d largest_mm_;
};

}  // namespace

std::vector<Component> bright_components(const CtVolume& ct, double threshold_hu,
                                         const Vector3d& largest_mm) {
  return ComponentSearch(ct, threshold_hu, largest_mm).search();
}

}  // namespace usct::evaluation
