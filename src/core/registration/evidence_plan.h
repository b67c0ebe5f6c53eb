#pragma once

#include "us_ct_registration/registration/registration_options.h"

namespace usct::registration {

/// Which evidence decides about a pose, by ConfidenceOptions::evidence.
class EvidencePlan {
 public:
  explicit EvidencePlan(const ConfidenceOptions& options)
      : source_(options.evidence), limit_(options.gates.max_wrong_probability) {}

  /// Whether a gate asks for evidence.
  bool gathers() const { return limit_.has_value(); }
  /// Whether it does, and the preset `patient` gathers it, whatever found the pose.
  bool is_judged_as_patient() const { return gathers() && source_ == EvidenceSource::kPatient; }
  /// Whether the images of the preset `patient` may be needed too.
  bool may_need_patient() const { return gathers() && source_ != EvidenceSource::kOwn; }
  /// Whether the registration goes on as the preset `patient` where its own evidence leaves doubt.
  bool may_go_on_as_patient() const { return gathers() && source_ == EvidenceSource::kOwnFirst; }
  /// Whether the gate on the evidence lets a pose pass; it does if there is none.
  bool accepts(const Measures& measures) const;

 private:
  EvidenceSource source_;
  std::optional<double> limit_;
};

}  // namespace usct::registration
