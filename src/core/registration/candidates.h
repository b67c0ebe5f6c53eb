#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "registration/run.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct::registration {

/// A pose and what a similarity says of it.
struct Candidate {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  AcquisitionErrors errors;
  /// The lowest of all where the similarity has no value.
  double value = -std::numeric_limits<double>::infinity();
  double overlap = 0.0;

  bool has_value() const { return value > -std::numeric_limits<double>::infinity(); }
  SimilarityPose pose() const { return {T_us_ct.inverse(), errors}; }
};

/// Positions all over what the ultrasound sees, US frame, mm: distances between poses are mean
/// displacements of these points.
class FieldPoints {
 public:
  FieldPoints() = default;
  explicit FieldPoints(std::vector<Eigen::Vector3d> points_us_mm)
      : points_us_mm_(std::move(points_us_mm)) {}

  double distance_mm(const Eigen::Isometry3d& T_a_us_ct, const Eigen::Isometry3d& T_b_us_ct) const;
  const std::vector<Eigen::Vector3d>& us_mm() const { return points_us_mm_; }

 private:
  std::vector<Eigen::Vector3d> points_us_mm_;
};

/// Fills in value and overlap.
void evaluate(const Similarity& similarity, std::vector<Candidate>& candidates, Run& run);

/// Options for climbing from candidates.
struct Climb {
  const OptimizerOptions& optimizer;
  double reach_mm;
  /// Limits within which AcquisitionErrors are estimated as well; 0: not.
  AcquisitionErrors error_limits;
  std::uint32_t seed;
};

/// Moves each candidate that has a value to an optimum near by, in parallel over the candidates;
/// one alone leaves the threads to the similarity.
void climb(const Similarity& similarity, const Climb& how, const FieldPoints& field,
           std::vector<Candidate>& candidates, Run& run);

/// Best first, `most` in all; candidates of equal value keep their order.
void sort_best_first(std::vector<Candidate>& candidates, std::size_t most);

/// Best first; of candidates closer than `distinct_mm` only the best stays, and `most` in all.
std::vector<Candidate> best_distinct(std::vector<Candidate> candidates, double distinct_mm,
                                     std::size_t most, const FieldPoints& field);

}  // namespace usct::registration
