#include "us_ct_registration/registration/gates.h"

#include <algorithm>
#include <cmath>

#include "require.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

struct Gate {
  const char* measure;
  std::optional<double> Measures::*value;
  bool at_least;
  std::optional<double> GateLimits::*limit;
  /// Meaning of a failed gate, for the message.
  const char* meaning;
  bool no_overlap = false;
};

/// The gates in the order in which they are judged; the first failed gate gives the reason.
const std::vector<Gate>& gates() {
  static const std::vector<Gate> all = {
      {"overlap", &Measures::overlap, true, &GateLimits::min_overlap,
       "CT and ultrasound share too little", true},
      {"wrong_probability", &Measures::wrong_probability, false, &GateLimits::max_wrong_probability,
       "the pose is not trusted"},
  };
  return all;
}

/// A value and its limit, with as many digits as tell one from the other.
std::pair<std::string, std::string> numbers(double value, double limit) {
  constexpr int kMostDigits = 17;
  for (int digits = 3;; ++digits) {
    const auto text = [&](double number) { return formatted("%.*g", digits, number); };
    if (text(value) != text(limit) || digits == kMostDigits) return {text(value), text(limit)};
  }
}

/// The comparison is written so that a measure that is not a number fails.
bool passes(const Gate& gate, double value, double limit) {
  return gate.at_least ? value >= limit : value <= limit;
}

}  // namespace

const std::vector<MeasureField>& measure_fields() {
  static const std::vector<MeasureField> fields = {
      {"overlap", &Measures::overlap},
      {"displacement_mm", &Measures::displacement_mm},
      {"disagreement_mm", &Measures::disagreement_mm},
      {"mirror_ratio", &Measures::mirror_ratio},
      {"mirror_advantage", &Measures::mirror_advantage},
      {"chance_ratio", &Measures::chance_ratio},
      {"chance_advantage", &Measures::chance_advantage},
      {"rival_ratio", &Measures::rival_ratio},
      {"rival_advantage", &Measures::rival_advantage},
      {"parts_mm", &Measures::parts_mm},
      {"ridge_parts_mm", &Measures::ridge_parts_mm},
      {"local_agreement", &Measures::local_agreement},
      {"mirror_agreement", &Measures::mirror_agreement},
      {"local_advantage", &Measures::local_advantage},
      {"tissue_motion_mm", &Measures::tissue_motion_mm},
      {"wide_motion_mm", &Measures::wide_motion_mm},
      {"deformation_mm", &Measures::deformation_mm},
      {"wrong_probability", &Measures::wrong_probability},
      {"expected_error_mm", &Measures::expected_error_mm},
      {"error_bound_mm", &Measures::error_bound_mm},
      {"depth_error", &Measures::depth_error},
      {"sweep_error", &Measures::sweep_error},
      {"sweep_unevenness", &Measures::sweep_unevenness},
      {"errors_ratio", &Measures::errors_ratio},
      {"errors_advantage", &Measures::errors_advantage},
      {"sweep_motion_mm", &Measures::sweep_motion_mm},
  };
  return fields;
}

std::map<std::string, double> by_name(const Measures& measures) {
  std::map<std::string, double> values;
  for (const MeasureField& field : measure_fields())
    if (const std::optional<double>& value = measures.*field.value) values[field.name] = *value;
  return values;
}

Measures measures_from(const std::map<std::string, double>& values, const std::string& source) {
  Measures measures;
  for (const auto& [name, value] : values) {
    const std::vector<MeasureField>& fields = measure_fields();
    const auto found =
        std::find_if(fields.begin(), fields.end(),
                     [&known = name](const auto& field) { return known == field.name; });
    if (found == fields.end()) throw InputError(source, "measure '" + name + "' is unknown");
    measures.*found->value = value;
  }
  return measures;
}

void GateLimits::validate(const std::string& source) const {
  const auto share = [&](const char* field, const std::optional<double>& value) {
    if (value) require(*value >= 0.0 && *value <= 1.0, source, field, *value, "within [0, 1]");
  };
  share("min_overlap", min_overlap);
  share("max_wrong_probability", max_wrong_probability);
}

std::optional<GateFailure> judge(const Measures& measures, const GateLimits& limits) {
  for (const Gate& gate : gates()) {
    const std::optional<double>& limit = limits.*gate.limit;
    if (!limit) continue;
    const std::optional<double>& value = measures.*gate.value;
    if (value && passes(gate, *value, *limit)) continue;
    const auto [value_text, limit_text] = numbers(value.value_or(*limit), *limit);
    const std::string found = value ? "is " + value_text : "was not measured";
    return GateFailure{gate.no_overlap, std::string(gate.meaning) + ": " + gate.measure + " " +
                                            found + ", must be " + (gate.at_least ? ">= " : "<= ") +
                                            limit_text};
  }
  return std::nullopt;
}

}  // namespace usct
