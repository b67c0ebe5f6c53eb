#include "us_ct_registration/registration/gates.h"

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
