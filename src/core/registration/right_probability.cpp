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

/// Blocks that agree less than this speak against the pose, whatever else is known, and the log
/// odds fall by kPerTooLittleAgreement times what is missing. Only what blocks of mirror images
/// reach says more: noise and a low contrast let blocks agree little at the right pose (0.12 to
/// 0.24 in kidneys of a real CT), but those of mirror images then agree as little as chance gives.
constexpr double kLeastAgreement = 0.24;
constexpr double kPerTooLittleAgreement = 30.0;

/// No evidence of one kind is so strong that it makes up for any weakness of the other.
constexpr double kMostChanceOdds = 4.0;
constexpr double kMostAnatomyOdds = 3.0;
/// Beside the anatomy, standing out from chance counts for no more log odds than this: the kidney
/// of another patient stands out from chance as well.
constexpr double kMostChanceBesideAnatomy = 1.0;

/// Poses farther off are wrong.
constexpr double kWrongMm = 5.0;

/// The comparison with mirror images, within the range in which the calibration has seen it. The
/// last one is by how much more clusters agree with the pose than those of any mirror image.
struct MirrorComparison {
  double log_ratio;
  double advantage;
  std::optional<double> agreement;
};
MirrorComparison mirror_comparison(const Measures& m) {
  MirrorComparison compared{
      log_within(*m.mirror_ratio, 0.7, 2.5), std::clamp(*m.mirror_advantage, -3.0, 6.0), {}};
  if (m.mirror_agreement)
    compared.agreement = std::clamp(*m.local_agreement - *m.mirror_agreement, -0.3, 0.3);
  return compared;
}

/// The log odds that the ultrasound is not one of its mirror images. Where these fit almost as
/// well, agreement can still tell them apart.
double mirrors_log_odds(const MirrorComparison& mirrors) {
  const double by_fit = -0.8 + 4.0 * mirrors.log_ratio + 1.55 * mirrors.advantage;
  if (!mirrors.agreement) return by_fit;
  return std::max(by_fit, -3.0 + 0.9 * mirrors.advantage + 40.0 * *mirrors.agreement);
}

/// The log odds that the CT shows the anatomy that is in the ultrasound, and not a like one.
double anatomy_log_odds(const Measures& m, const MirrorComparison& mirrors) {
  const double agreement = *m.local_agreement;
  const double together = mirrors.agreement
                              ? 1.8 + 3.5 * agreement - 3.3 * *m.tissue_motion_mm +
                                    0.2 * mirrors.advantage + 32.0 * *mirrors.agreement
                              : -11.3 + 30.0 * agreement - 2.75 * *m.tissue_motion_mm +
                                    4.6 * mirrors.log_ratio + 1.8 * mirrors.advantage;
  const double most =
      mirrors.agreement
          ? kMostAnatomyOdds
          : std::min(kMostAnatomyOdds, kPerTooLittleAgreement * (agreement - kLeastAgreement));
  const double torn = kTornPerMm * std::clamp(*m.parts_mm - kTornMm, 0.0, kMostTornMm);
  return std::min(together, most) - torn;
}

/// The probability that a normally distributed error in space, the same in all directions, is
/// shorter than kWrongMm (Maxwell's distribution).
double probability_near(double rms_mm) {
  const double ratio = kWrongMm / std::max(rms_mm, 1e-3);
  return boost::math::gamma_p(1.5, 1.5 * ratio * ratio);
}

}  // namespace

double RightProbability::all() const {
  const double counts = std::min(chance, logistic(kMostChanceBesideAnatomy));
  const double against = (1.0 - counts) * (1.0 - anatomy);
  return mirrors * near * counts * anatomy / (counts * anatomy + against);
}

std::optional<RightProbability> right_probability(const Measures& m) {
  for (const std::optional<double>& value :
       {m.displacement_mm, m.mirror_ratio, m.mirror_advantage, m.rival_ratio, m.rival_advantage,
        m.parts_mm, m.local_agreement, m.tissue_motion_mm})
    if (!value || std::isnan(*value)) return std::nullopt;
  for (const std::optional<double>& value : {m.expected_error_mm, m.mirror_agreement})
    if (value && std::isnan(*value)) return std::nullopt;
  const double far = std::max(0.0, *m.displacement_mm - kUsualDisplacementMm) / kPerMm;
  const MirrorComparison mirrors = mirror_comparison(m);
  RightProbability right;
  right.mirrors = logistic(mirrors_log_odds(mirrors));
  right.chance = logistic(
      std::min(kMostChanceOdds, -4.0 + 5.3 * log_within(*m.rival_ratio, 0.7, 3.0) +
                                    0.7 * std::clamp(*m.rival_advantage, -3.0, 6.0) - far));
  right.anatomy = logistic(anatomy_log_odds(m, mirrors));
  if (m.expected_error_mm) right.near = probability_near(*m.expected_error_mm);
  return right;
}

std::optional<double> wrong_probability(const Measures& measures) {
  const std::optional<RightProbability> right = right_probability(measures);
  if (!right) return std::nullopt;
  return 1.0 - right->all();
}

}  // namespace usct
