#pragma once

#include <Eigen/Geometry>
#include <mutex>
#include <vector>

#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct::registration {

/// A pose and what a similarity says of it.
struct Candidate {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  AcquisitionErrors errors;
  /// The lowest of all where the similarity has no value.
  double value = -std::numeric_limits<double>::infinity();
  double overlap = 0.0;
};

/// Thrown through loops when the caller wants to stop.
struct Cancelled {};

/// Evaluates and optimises candidates of one registration, in parallel over candidates; one alone
/// leaves the threads to the similarity.
class Search {
 public:
  Search(const std::vector<Eigen::Vector3d>& points_us_mm, const RegistrationOptions& options,
         const RegistrationHooks& hooks)
      : points_us_mm_(points_us_mm), options_(options), hooks_(hooks) {}

  /// Fills in value and overlap.
  void evaluate(const Similarity& similarity, std::vector<Candidate>& candidates);
  /// Moves each to an optimum near by.
  void optimise(const Similarity& similarity, const StageOptions& stage,
                std::vector<Candidate>& candidates);
  /// Best first; of candidates that are not distinct only the best stays, and `most` in all.
  std::vector<Candidate> best_distinct(std::vector<Candidate> candidates, std::size_t most) const;
  /// Best first, `most` in all; those of equal value in the order in which they came.
  static void sort(std::vector<Candidate>& candidates, std::size_t most);

  /// Mean displacement between two poses of what the ultrasound sees, mm.
  double distance_mm(const Eigen::Isometry3d& T_a_us_ct, const Eigen::Isometry3d& T_b_us_ct) const;
  const std::vector<Eigen::Vector3d>& points_us_mm() const { return points_us_mm_; }
  int evaluations() const { return evaluations_; }
  /// Throws Cancelled if the caller wants to stop.
  void check_cancelled() const;

 private:
  int optimise(const Similarity& similarity, const StageOptions& stage, Candidate& candidate) const;

  const std::vector<Eigen::Vector3d>& points_us_mm_;
  const RegistrationOptions& options_;
  const RegistrationHooks& hooks_;
  mutable std::mutex asking_;  // a critical section would not let through what the caller throws
  int evaluations_ = 0;
};

}  // namespace usct::registration
