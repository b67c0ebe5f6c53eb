#include "us_ct_registration/registration/registration_options.h"

#include <cmath>

#include "require.h"

namespace usct {
namespace {

void require_share(double value, const std::string& source, const std::string& field, double most) {
  require(value >= 0.0 && value <= most, source, field, value,
          "within [0, " + std::to_string(most) + "]");
}

}  // namespace

void StageOptions::validate(const std::string& source) const {
  require(is_positive(spacing_mm), source, "spacing_mm", spacing_mm, "finite and > 0");
  similarity.validate(source + ".similarity");
  if (starts) starts->validate(source + ".starts");
  require(optimised >= 1, source, "optimised", optimised, ">= 1");
  require(kept >= 1, source, "kept", kept, ">= 1");
  optimizer.validate(source + ".optimizer");
  // What every optimizer needs of a box.
  require(std::isfinite(reach_mm) && reach_mm >= 2.0 * optimizer.step_tolerance, source, "reach_mm",
          reach_mm, "finite and >= twice optimizer.step_tolerance");
  constexpr double kMostError = 0.2;
  require_share(depth_error, source, "depth_error", kMostError);
  require_share(sweep_error, source, "sweep_error", kMostError);
}

void ConfidenceOptions::validate(const std::string& source) const {
  require_share(min_overlap, source, "min_overlap", 1.0);
  require(background >= 16, source, "background", background, ">= 16");
  require(is_positive(background_mm), source, "background_mm", background_mm, "finite and > 0");
  require(!std::isnan(min_significance), source, "min_significance", min_significance, "a number");
  require_share(min_margin, source, "min_margin", 1.0);
  require(max_disagreement_mm >= 0.0, source, "max_disagreement_mm", max_disagreement_mm, ">= 0");
  require(max_displacement_mm >= 0.0, source, "max_displacement_mm", max_displacement_mm, ">= 0");
  confirmation.validate(source + ".confirmation");
  require(max_scatter_mm >= 0.0, source, "max_scatter_mm", max_scatter_mm, ">= 0");
  require(is_positive(deviation_factor), source, "deviation_factor", deviation_factor,
          "finite and > 0");
  require(std::isfinite(systematic_mm) && systematic_mm >= 0.0, source, "systematic_mm",
          systematic_mm, "finite and >= 0");
}

void RegistrationOptions::validate(const std::string& source) const {
  window.validate(source + ".window");
  require(outside_hu >= window.low_hu && outside_hu <= window.high_hu, source, "outside_hu",
          outside_hu, "within the window");
  require(is_positive(conditioning_spacing_mm), source, "conditioning_spacing_mm",
          conditioning_spacing_mm, "finite and > 0");
  conditioning.validate(source + ".conditioning");
  simulation.validate(source + ".simulation");
  fit.validate(source + ".fit");
  require(!stages.empty(), source, "stages", 0.0, "one at least");
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const std::string stage = source + ".stages[" + std::to_string(i) + "]";
    stages[i].validate(stage);
    if (i > 0 && stages[i].starts)
      throw InputError(stage, "'starts' are given, only the first stage may have some");
    if (i + 1 < stages.size() && (stages[i].depth_error > 0.0 || stages[i].sweep_error > 0.0))
      throw InputError(stage, "estimates acquisition errors, only the last stage may");
  }
  require(rounds >= 1 && rounds <= 6, source, "rounds", rounds, "within [1, 6]");
  require(std::isfinite(distinct_mm) && distinct_mm >= 0.0, source, "distinct_mm", distinct_mm,
          "finite and >= 0");
  confidence.validate(source + ".confidence");
}

}  // namespace usct
