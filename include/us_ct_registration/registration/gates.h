#pragma once

#include <optional>
#include <string>

#include "us_ct_registration/registration/measures.h"

/// The limits that the measures of a pose must keep for it to be believed.
namespace usct {

/// Limits on Measures; unset switches a gate off. A measure that is absent (or not a number) fails
/// its gate.
struct GateLimits {
  std::optional<double> min_overlap = 0.2;            // [0, 1]
  std::optional<double> max_wrong_probability = 0.3;  // [0, 1]

  /// No gate at all, for studies that ask for poses without a judgement.
  static GateLimits none() { return {std::nullopt, std::nullopt}; }
  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, GateLimits& o) {
  fields("min_overlap", o.min_overlap);
  fields("max_wrong_probability", o.max_wrong_probability);
}

/// The first failed gate in words: its meaning, the measure, its value and its limit.
struct GateFailure {
  bool no_overlap = false;
  std::string message;
};

/// Judges the measures by the limits; empty if all gates pass.
std::optional<GateFailure> judge(const Measures& measures, const GateLimits& limits);

}  // namespace usct
