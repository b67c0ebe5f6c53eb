#include "us_ct_registration/registration/gates.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "require.h"

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
      {"significance", &Measures::significance, true, &GateLimits::min_significance,
       "the best pose is no better than chance"},
      {"margin", &Measures::margin, true, &GateLimits::min_margin,
       "another pose is almost as good"},
      {"disagreement_mm", &Measures::disagreement_mm, false, &GateLimits::max_disagreement_mm,
       "search and refinement disagree"},
      {"displacement_mm", &Measures::displacement_mm, false, &GateLimits::max_displacement_mm,
       "the pose is far from the initial one"},
      {"scatter_mm", &Measures::scatter_mm, false, &GateLimits::max_scatter_mm,
       "parts of the ultrasound pull the pose apart"},
  };
  return all;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

/// The comparison is written so that a measure that is not a number fails.
bool passes(const Gate& gate, double value, double limit) {
  return gate.at_least ? value >= limit : value <= limit;
}

}  // namespace

const std::vector<MeasureField>& measure_fields() {
  static const std::vector<MeasureField> fields = {
      {"overlap", &Measures::overlap},
      {"significance", &Measures::significance},
      {"margin", &Measures::margin},
      {"disagreement_mm", &Measures::disagreement_mm},
      {"displacement_mm", &Measures::displacement_mm},
      {"scatter_mm", &Measures::scatter_mm},
      {"expected_error_mm", &Measures::expected_error_mm},
      {"depth_error", &Measures::depth_error},
      {"sweep_error", &Measures::sweep_error},
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
  const auto distance = [&](const char* field, const std::optional<double>& value) {
    if (value) require(*value >= 0.0, source, field, *value, ">= 0");
  };
  share("min_overlap", min_overlap);
  if (min_significance)
    require(!std::isnan(*min_significance), source, "min_significance", *min_significance,
            "a number");
  share("min_margin", min_margin);
  distance("max_disagreement_mm", max_disagreement_mm);
  distance("max_displacement_mm", max_displacement_mm);
  distance("max_scatter_mm", max_scatter_mm);
}

std::optional<GateFailure> judge(const Measures& measures, const GateLimits& limits) {
  for (const Gate& gate : gates()) {
    const std::optional<double>& limit = limits.*gate.limit;
    if (!limit) continue;
    const std::optional<double>& value = measures.*gate.value;
    if (value && passes(gate, *value, *limit)) continue;
    const std::string found = value ? "is " + number(*value) : "was not measured";
    return GateFailure{gate.no_overlap, std::string(gate.meaning) + ": " + gate.measure + " " +
                                            found + ", must be " + (gate.at_least ? ">= " : "<= ") +
                                            number(*limit)};
  }
  return std::nullopt;
}

}  // namespace usct
