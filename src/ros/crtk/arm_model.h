#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

namespace KDL {
class Chain;
}

namespace usct::ros_interface {

/// The kinematic chain of one arm, from the model of a robot (URDF).
class ArmModel {
 public:
  /// `urdf` is the text of the model; `base` and `tip` are links of it. Throws InputError, naming
  /// `robot_description`, unless it is a model in which movable joints connect the two.
  ArmModel(const std::string& urdf, const std::string& base, const std::string& tip);
  ~ArmModel();

  /// Names of the movable joints, from base to tip.
  const std::vector<std::string>& joints() const { return joints_; }
  /// p_base = T p_tip, mm. `positions` has one value for each of `joints()`, in the same order, rad
  /// or m.
  Eigen::Isometry3d T_base_tip(const std::vector<double>& positions) const;

 private:
  std::unique_ptr<const KDL::Chain> chain_;
  std::vector<std::string> joints_;
};

}  // namespace usct::ros_interface
