#pragma once

#include <optional>
#include <string>

#include "us_ct_registration/registration/measures.h"

/// The probability that a pose is right, by all evidence together.
namespace usct {

/// The most by which halves of the field move the pose, mm, by either of their similarities. Needs
/// `parts_mm`.
double halves_motion_mm(const Measures& measures);

/// The probability that the pose is right as far as each of the three kinds of evidence can tell,
/// and the probability that a right one is less than 5 mm off.
struct RightProbability {
  double mirrors = 0.0;  // it is better than the mirrored ultrasound
  double chance = 0.0;   // it is better than poses elsewhere, which chance reaches
  double anatomy = 0.0;  // the CT shows this anatomy, and not a like one: parts of the field agree
  double near = 1.0;     // its error is below 5 mm, if it is as large as expected

  /// All together. Chance and anatomy both ask whether the pose is a firm optimum, so that their
  /// odds are multiplied; those of chance count up to a limit, since the kidney of another patient
  /// stands out from chance as well. Mirrored ultrasound has firm optima too, and a firm optimum of
  /// tissue that has moved is no close one: these probabilities are factors.
  double all() const;
};

/// Logistic functions of the measures, calibrated on equally many right and wrong poses
/// (docs/confidence.md). Unset if a measure is absent or not a number. The expected error,
/// mirror_agreement, ridge_parts_mm and wide_motion_mm may be absent: they then say nothing.
std::optional<RightProbability> right_probability(const Measures& measures);

/// Why right_probability is unset, in words: nothing was gathered, as without the gate on it, or
/// which measure is missing. Empty if it is set.
std::string missing_evidence(const Measures& measures);

/// Measures::wrong_probability by all evidence; unset as above.
std::optional<double> wrong_probability(const Measures& measures);

}  // namespace usct
