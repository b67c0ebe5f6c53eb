#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

/// The evidence for a pose. A new measure is a member of Measures and a row of the table in
/// measures.cpp.
namespace usct {

/// How a case can be mirrored. Of the ultrasound the lines, the frames or both may be in reverse
/// order; both together are a half turn of the probe about its beams. Of the three axes of the CT's
/// grid one may be reversed, or two exchanged.
enum class Mirror {
  kLines,
  kFrames,
  kHalfTurn,
  kCtAxis1,
  kCtAxis2,
  kCtAxis3,
  kCtAxes12,
  kCtAxes13,
  kCtAxes23
};

/// Measures of a registration; a measure that was not taken is absent.
struct Measures {
  /// Share of the ultrasound's samples that lie in the CT, in [0, 1].
  std::optional<double> overlap;
  /// Distance of the pose from the initial one, mm (mean displacement of the field of view).
  std::optional<double> displacement_mm;
  /// Distance by which the refinement moved the best optimum of the search, mm (mean displacement
  /// of the field of view).
  std::optional<double> disagreement_mm;
  /// Similarity of the best optimum over that of the best mirrored ultrasound (see Mirror); over
  /// that of a mirrored CT, if that fits better than the optimum.
  std::optional<double> mirror_ratio;
  /// Student's t of the same comparison, patch by patch: the least of all mirrored ultrasound.
  std::optional<double> mirror_advantage;
  /// Similarity of the best optimum over the median of the mirrored ultrasound, which chance can
  /// reach.
  std::optional<double> chance_ratio;
  /// Student's t of that comparison, patch by patch: the median.
  std::optional<double> chance_advantage;
  /// Similarity of the best optimum over that of the best rival, a pose elsewhere; as chance_ratio
  /// if there is no rival.
  std::optional<double> rival_ratio;
  /// Student's t of that comparison, patch by patch: the least of the best rivals; as
  /// chance_advantage if there is no rival.
  std::optional<double> rival_advantage;
  /// Median distance by which halves of the field move the pose, mm (mean displacement of the field
  /// of view), by patches almost without a ridge and by patches with one.
  std::optional<double> parts_mm;
  std::optional<double> ridge_parts_mm;
  /// How far clusters of patches lie where they would like to, at the pose and as their neighbours
  /// wish: near 1 if all do, about 0 or less if their wishes have nothing to do with the pose nor
  /// with each other.
  std::optional<double> local_agreement;
  /// The same of the mirrored ultrasound that reaches most, with its patches where they fit best.
  /// It is taken where the other evidence leaves doubt, and makes a difference.
  std::optional<double> mirror_agreement;
  /// How surely the clusters are more similar at the pose than beside it: the sum of what each
  /// gains over the mean of the translations offered to it, over the root of the sum of the squares
  /// of these gains. About 0 for a pose that has nothing to do with them, and the root of the
  /// number of clusters at most.
  std::optional<double> local_advantage;
  /// About how far tissue near the middle of the field would rather lie elsewhere, root mean
  /// square, mm: the translations that clusters there wish together with their neighbours, by whole
  /// steps.
  std::optional<double> tissue_motion_mm;
  /// The same of wider groups of clusters, over which noise averages out, mm.
  std::optional<double> wide_motion_mm;
  /// The same between these translations, without what a wrong step of the motor or a wrong path of
  /// the tracker explains, mm: a part of the expected error.
  std::optional<double> deformation_mm;
  /// Probability that the pose is more than 5 mm off, for inputs of which half are right: see the
  /// function of this name.
  std::optional<double> wrong_probability;
  /// Root mean square error that the covariance predicts in the middle of the field of view, mm,
  /// and the bound below which the error lies in 90 of 100 registrations that are right.
  std::optional<double> expected_error_mm;
  std::optional<double> error_bound_mm;
  /// Errors of the acquisition, estimated by a check of the final pose; see AcquisitionErrors. An
  /// error of the depths that the images show is a part of the expected error.
  std::optional<double> depth_error;
  std::optional<double> sweep_error;
  std::optional<double> sweep_unevenness;
  /// Similarity with the errors of that check over the most that a pose near by reaches without
  /// any, and Student's t of this comparison, patch by patch.
  std::optional<double> errors_ratio;
  std::optional<double> errors_advantage;
  /// Longest way by which a probe that should have been still moved a sample during the sweep, mm;
  /// from tf, so that only the ROS interface takes it.
  std::optional<double> sweep_motion_mm;
};

/// A measure with its name in files, messages and limits.
struct MeasureField {
  const char* name;
  std::optional<double> Measures::*value;
};
const std::vector<MeasureField>& measure_fields();

/// The measures that are present, by name.
std::map<std::string, double> by_name(const Measures& measures);

/// The inverse of `by_name`. Throws InputError, naming `source`, for a name that is no measure.
Measures measures_from(const std::map<std::string, double>& values, const std::string& source);

}  // namespace usct
