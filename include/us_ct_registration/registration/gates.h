#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

/// Confidence in a registration: its measures, and the limits that they must keep. A new gate is a
/// member of Measures, a limit in GateLimits and a row of each table in gates.cpp.
namespace usct {

/// Measures of a registration; a measure that was not taken is absent.
struct Measures {
  /// Share of the ultrasound's samples that lie in the CT, in [0, 1].
  std::optional<double> overlap;
  /// Height of the best optimum's similarity above that of background poses, in their standard
  /// deviations.
  std::optional<double> significance;
  /// Height of the best optimum above the best rival, as a share of its height above the
  /// background.
  std::optional<double> margin;
  /// Distance by which the refinement moved the best optimum of the search, mm (mean displacement
  /// of the field of view).
  std::optional<double> disagreement_mm;
  /// Distance of the pose from the initial one, mm (mean displacement of the field of view).
  std::optional<double> displacement_mm;
  /// Scatter of the pose among the parts of a second similarity, mm (root mean square displacement
  /// of the field of view).
  std::optional<double> scatter_mm;
  /// Root mean square displacement of the field of view that the covariance predicts, mm.
  std::optional<double> expected_error_mm;
  /// Errors of the acquisition, if the refinement estimated them; see AcquisitionErrors.
  std::optional<double> depth_error;
  std::optional<double> sweep_error;
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

/// Limits on Measures; unset switches a gate off. A measure that is absent (or not a number) fails
/// its gate.
struct GateLimits {
  std::optional<double> min_overlap = 0.2;       // [0, 1]
  std::optional<double> min_significance = 8.0;  // any number
  std::optional<double> min_margin = 0.1;        // [0, 1]
  std::optional<double> max_disagreement_mm = 5.0;
  std::optional<double> max_displacement_mm = 40.0;
  std::optional<double> max_scatter_mm = 0.5;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, GateLimits& o) {
  fields("min_overlap", o.min_overlap);
  fields("min_significance", o.min_significance);
  fields("min_margin", o.min_margin);
  fields("max_disagreement_mm", o.max_disagreement_mm);
  fields("max_displacement_mm", o.max_displacement_mm);
  fields("max_scatter_mm", o.max_scatter_mm);
}

/// The first failed gate in words: its meaning, the measure, its value and its limit.
struct GateFailure {
  bool no_overlap = false;
  std::string message;
};

/// Judges the measures by the limits; empty if all gates pass.
std::optional<GateFailure> judge(const Measures& measures, const GateLimits& limits);

}  // namespace usct
