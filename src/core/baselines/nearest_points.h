#pragma once

#include <Eigen/Core>
#include <nanoflann.hpp>
#include <vector>

namespace usct {

/// Search for the nearest points of a surface. The points must outlive the search.
class NearestPoints {
 public:
  explicit NearestPoints(const std::vector<Eigen::Vector3d>& points_mm)
      : points_(points_mm), tree_(3, *this) {}

  struct Nearest {
    std::size_t index = 0;
    double square_distance_mm2 = 0.0;
  };
  Nearest nearest(const Eigen::Vector3d& p_mm) const {
    unsigned index = 0;
    double square = 0.0;
    tree_.knnSearch(p_mm.data(), 1, &index, &square);
    return {index, square};
  }

  /// Indices of the `count` nearest points, or of all if there are fewer.
  std::vector<unsigned> nearest(const Eigen::Vector3d& p_mm, std::size_t count) const {
    std::vector<unsigned> indices(count);
    std::vector<double> squares(count);
    indices.resize(tree_.knnSearch(p_mm.data(), count, indices.data(), squares.data()));
    return indices;
  }

  // The tree asks for the points by these names.
  std::size_t kdtree_get_point_count() const { return points_.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points_[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;  // the tree computes the box itself
  }

 private:
  const std::vector<Eigen::Vector3d>& points_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, NearestPoints>,
                                      NearestPoints, 3>
      tree_;
};

}  // namespace usct
