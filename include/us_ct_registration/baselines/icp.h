#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

namespace usct {

struct IcpOptions {
  /// Share of the ultrasound's points that the CT shows as well; (0, 1]. In each iteration the
  /// pairs with the largest distances beyond this share are left out, so that parts that only the
  /// ultrasound shows do not pull (trimmed ICP, Chetverikov 2005). Parts that only the CT shows
  /// need no trimming.
  double overlap = 1.0;
  /// Pairs farther apart than this never count, mm; > 0.
  double largest_distance_mm = 30.0;
  /// A step that moves the surface by less than this ends the iterations, mm; > 0. Points may
  /// alternate between two neighbours for ever, so that steps of noisy surfaces do not vanish.
  double tolerance_mm = 0.01;
  int largest_iterations = 100;

  /// Throws InputError naming the option, its value and the constraint.
  void validate() const;
};

/// The axis of a motion of the ultrasound's surface: p moves by
/// `shift + turn.cross(p - centre_us_mm)`.
struct SurfaceMotion {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
};

struct IcpResult {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Whether the last step was below the tolerance.
  bool converged = false;
  int iterations = 0;
  /// Pairs that the last step used, and their root mean square distances, mm: between the points,
  /// and from the tangent plane of the CT's surface, which is what the method minimizes. The former
  /// contains the spacing of the points.
  int pairs = 0;
  double distance_mm = 0.0;
  double plane_distance_mm = 0.0;
  /// The distance of all points of the ultrasound from the nearest ones of the CT, root mean
  /// square, mm, where a farther one counts as IcpOptions::largest_distance_mm. Of two alignments
  /// the better one has less: the pairs that an alignment leaves out are those that speak against
  /// it.
  double capped_distance_mm = 0.0;
  /// Root mean square displacement of the surface's points that independent errors of the points
  /// of the observed `plane_distance_mm` predict, mm. Errors that neighbouring points share, as
  /// those of a segmentation do, make it too small.
  double predicted_error_mm = 0.0;
  /// The least information about a motion, 0 to about 1: the mean square share of a motion that is
  /// along the surface's normals. `information_floor` is the part of it that noise of the estimated
  /// normals would give to a perfect sphere.
  double least_information = 0.0;
  double information_floor = 0.0;
  /// The motion that the surfaces determine least, and the point about which it turns.
  SurfaceMotion least_determined;
  Eigen::Vector3d centre_us_mm = Eigen::Vector3d::Zero();

  /// Whether the surfaces slide along each other in the motion above (sphere, cylinder, plane), so
  /// that the start and noise decide how far.
  bool undetermined() const;
};

/// Aligns two surfaces, given by points spread evenly over each, by the iterative closest point
/// method with distances from the tangent planes of the CT's surface (Chen and Medioni 1992): each
/// point of the ultrasound is paired with the nearest of the CT, whose normal its neighbours give.
///
/// Throws InputError if the options are out of range, a surface has fewer than 20 points or lies on
/// a line, or fewer than 20 pairs are within the largest distance: the surfaces do not overlap. The
/// names are those of the surfaces in its message, such as their files.
IcpResult icp(const std::vector<Eigen::Vector3d>& surface_us_mm,
              const std::vector<Eigen::Vector3d>& surface_ct_mm,
              const Eigen::Isometry3d& start_T_us_ct, const IcpOptions& options = {},
              const std::string& us_name = "ultrasound surface",
              const std::string& ct_name = "CT surface");

}  // namespace usct
