#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

#include "us_ct_registration/registration/gates.h"

namespace usct {
namespace {

double logistic(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

/// The logarithm of a value within the range in which the calibration has seen it; a value beyond
/// counts as its end, since nothing says that the trend goes on.
double log_within(double value, double low, double high) {
  return std::log(std::clamp(value, low, high));
}

/// Poses farther than this from the initial one need stronger evidence: the log odds fall by one
/// for every kPerMm.
constexpr double kUsualDisplacementMm = 40.0;
constexpr double kPerMm = 10.0;

/// Halves of the field that move a pose by this much leave it uncertain by almost 5 mm, whatever
/// the rest says: the log odds fall by kTornPerMm for every mm beyond. No right pose of the
/// calibration came near, so that this limit is a matter of reason.
constexpr double kTornMm = 4.0;
constexpr double kMostTornMm = 4.0;
constexpr double kTornPerMm = 2.0;

/// The local agreement at which parts of the field say nothing, and how fast the log odds rise with
/// it: docs/confidence.md says how they were chosen.
constexpr double kEvenAgreement = 0.28;
constexpr double kPerAgreement = 60.0;

/// No evidence of one kind is so strong that it makes up for any weakness of the other.
constexpr double kMostChanceOdds = 4.0;
constexpr double kMostPartsOdds = 3.0;
/// Beside parts, standing out from chance counts for no more log odds than this: the kidney of
/// another patient stands out from chance as well, and only parts of the field tell it.
constexpr double kMostChanceBesideParts = 1.0;

/// Poses farther off are wrong.
constexpr double kWrongMm = 5.0;

/// The probability that a normally distributed error in space, the same in all directions, is
/// shorter than kWrongMm (Maxwell's distribution).
double probability_near(double rms_mm) {
  const double ratio = kWrongMm / std::max(rms_mm, 1e-3);
  return boost::math::gamma_p(1.5, 1.5 * ratio * ratio);
}

}  // namespace

double RightProbability::all() const {
  const double counts = std::min(chance, logistic(kMostChanceBesideParts));
  const double against = (1.0 - counts) * (1.0 - parts);
  return mirrors * near * counts * parts / (counts * parts + against);
}

std::optional<RightProbability> right_probability(const Measures& m) {
  for (const std::optional<double>& value :
       {m.displacement_mm, m.mirror_ratio, m.mirror_advantage, m.rival_ratio, m.rival_advantage,
        m.parts_mm, m.local_agreement})
    if (!value || std::isnan(*value)) return std::nullopt;
  if (m.expected_error_mm && std::isnan(*m.expected_error_mm)) return std::nullopt;
  const double far = std::max(0.0, *m.displacement_mm - kUsualDisplacementMm) / kPerMm;
  const double torn = kTornPerMm * std::clamp(*m.parts_mm - kTornMm, 0.0, kMostTornMm);
  RightProbability right;
  right.mirrors = logistic(-0.8 + 4.0 * log_within(*m.mirror_ratio, 0.7, 2.5) +
                           1.55 * std::clamp(*m.mirror_advantage, -3.0, 6.0));
  right.chance = logistic(
      std::min(kMostChanceOdds, -4.0 + 5.3 * log_within(*m.rival_ratio, 0.7, 3.0) +
                                    0.7 * std::clamp(*m.rival_advantage, -3.0, 6.0) - far));
  const double agreement = kPerAgreement * (*m.local_agreement - kEvenAgreement);
  right.parts = logistic(std::min(kMostPartsOdds, agreement) - torn);
  if (m.expected_error_mm) right.near = probability_near(*m.expected_error_mm);
  return right;
}

}  // namespace usct
