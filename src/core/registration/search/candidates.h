#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "registration/images/field_points.h"
#include "registration/run.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct::registration {

/// Errors of the acquisition that one unit of an optimizer's step changes: one per cent moves the
/// far end of a usual field of view by about a millimetre.
constexpr double kErrorPerUnit = 0.01;

/// A pose and its similarity.
struct Candidate {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  AcquisitionErrors errors;
  /// Value of the similarity; the lowest of all if it has none.
  double value = -std::numeric_limits<double>::infinity();
  double overlap = 0.0;

  bool has_value() const { return value > -std::numeric_limits<double>::infinity(); }
  SimilarityPose pose() const { return {T_us_ct.inverse(), errors}; }
};

/// Fills in value and overlap of the candidates.
void evaluate(const Similarity& similarity, std::vector<Candidate>& candidates, Run& run);

/// Options for climbing from candidates. Where errors are estimated by a similarity that has no
/// derivatives by them, BOBYQA takes the place of Gauss-Newton.
struct Climb {
  const OptimizerOptions& optimizer;
  double reach_mm;
  /// Limits within which AcquisitionErrors are estimated as well; 0: not estimated.
  AcquisitionErrors error_limits;
  /// For a method that draws. Evidence takes the same in all registrations.
  std::uint32_t seed = 1;
};

/// Candidates that climb on one similarity, whether they have a value yet or not.
struct Climbers {
  const Similarity& similarity;
  std::vector<Candidate>& candidates;
};

/// Moves each candidate to a nearby optimum. One from which the optimizer cannot start has no value
/// then. The threads share the candidates of all groups, so that none waits for the last one of a
/// group; for a single candidate the similarity uses them instead.
void climb(const std::vector<Climbers>& groups, const Climb& how, const FieldPoints& field,
           Run& run);

/// The same for one group.
void climb(const Similarity& similarity, const Climb& how, const FieldPoints& field,
           std::vector<Candidate>& candidates, Run& run);

/// The optimum near one candidate.
Candidate climbed(const Similarity& similarity, const Climb& how, const FieldPoints& field,
                  const Candidate& from, Run& run);

/// Sorts best first and keeps `most` at most; candidates of equal value keep their order.
void sort_best_first(std::vector<Candidate>& candidates, std::size_t most);

/// The candidates best first, `most` at most; of those closer than `distinct_mm` only the best
/// stays.
std::vector<Candidate> best_distinct(std::vector<Candidate> candidates, double distinct_mm,
                                     std::size_t most, const FieldPoints& field);

/// The rivals of a pose: of `optima`, best first, those that lie over `rival_mm` from the first one
/// and come next. As many as a pose is compared with.
std::vector<Candidate> rivals_of(const std::vector<Candidate>& optima, double rival_mm,
                                 const FieldPoints& field);

}  // namespace usct::registration
