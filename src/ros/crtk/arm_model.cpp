#include "ros/crtk/arm_model.h"

#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl_parser/kdl_parser.hpp>

#include "ros/conversions/poses.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {

ArmModel::ArmModel(const std::string& urdf, const std::string& base, const std::string& tip) {
  const std::string source = "robot_description";
  KDL::Tree tree;
  if (!kdl_parser::treeFromString(urdf, tree)) throw InputError(source, "is not a URDF model");
  auto chain = std::make_unique<KDL::Chain>();
  if (!tree.getChain(base, tip, *chain))
    throw InputError(source, "has no chain from '" + base + "' to '" + tip + "'");
  for (const KDL::Segment& segment : chain->segments)
    if (segment.getJoint().getType() != KDL::Joint::None)
      joints_.push_back(segment.getJoint().getName());
  if (joints_.empty())
    throw InputError(source, "has no movable joint from '" + base + "' to '" + tip + "'");
  chain_ = std::move(chain);
}

ArmModel::~ArmModel() = default;

Eigen::Isometry3d ArmModel::T_base_tip(const std::vector<double>& positions) const {
  KDL::JntArray joints(static_cast<unsigned>(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i)
    joints(static_cast<unsigned>(i)) = positions[i];
  KDL::Frame frame;
  if (KDL::ChainFkSolverPos_recursive(*chain_).JntToCart(joints, frame) < 0)
    throw InputError("robot_description", "has a chain of " + std::to_string(joints_.size()) +
                                              " joints, but there are " +
                                              std::to_string(positions.size()) + " positions");
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(frame.M.data);
  T.translation() = kMmPerM * Eigen::Map<const Eigen::Vector3d>(frame.p.data);
  return T;
}

}  // namespace usct::ros_interface
