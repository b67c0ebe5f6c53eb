#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/registration/measures.h"

namespace usct {

/// Status of a registration. Only kRegistered comes with a transform.
enum class RegistrationStatus {
  kFailed,         // did not run to its end; the message says why
  kRegistered,     // found, and confident
  kLowConfidence,  // found something that must not be used as a registration
  kNoOverlap,      // CT and ultrasound share too little
  kCancelled,      // the caller ended it
};

/// "failed", "registered", "low_confidence", "no_overlap", "cancelled".
const char* status_name(RegistrationStatus status);

/// Throws InputError, naming `source`, for any other text.
RegistrationStatus parse_status(const std::string& name, const std::string& source);

/// One optimum of the similarity.
struct RegistrationCandidate {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  double similarity = 0.0;
  double overlap = 0.0;
};

/// Result of a registration. It starts as failed; nothing is valid by default.
struct RegistrationResult {
  RegistrationStatus status = RegistrationStatus::kFailed;
  /// The reason in words, for people.
  std::string message = "not run";
  /// `p_us = T_us_ct * p_ct`, mm; only if status is kRegistered.
  std::optional<Eigen::Isometry3d> T_us_ct;
  /// Value of the similarity at the best pose, higher is better; NaN if none was evaluated.
  double similarity = std::numeric_limits<double>::quiet_NaN();
  /// Fraction of the ultrasound's samples that lie in the CT, in [0, 1]; NaN if not evaluated.
  double overlap = std::numeric_limits<double>::quiet_NaN();
  /// Covariance of a small motion (w, t) that follows the best pose: `p_us -> p_us + w x p_us + t`,
  /// with w the rotation vector in rad and t in mm. The motion turns about the origin of the US
  /// frame, whatever centre the search used.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  /// Distinct optima: the pose that was judged, then the others, best first. The kidney is nearly
  /// symmetric, so a second pose may score almost as well.
  std::vector<RegistrationCandidate> candidates;
  /// The measures that the gates judged, and the errors that the check of the acquisition
  /// estimated.
  Measures measures;
  int evaluations = 0;
  /// Wall time per step, s: `ultrasound`, `ct`, `search`, `refinement`, `confidence`; `tracking` if
  /// that was tried (RegistrationTracker).
  std::map<std::string, double> seconds;
  /// The options of the run, as text.
  std::map<std::string, std::string> options;
  /// Version of this package that made the result.
  std::string version;
};

}  // namespace usct
