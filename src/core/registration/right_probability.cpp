#include "us_ct_registration/registration/right_probability.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace usct {
namespace {

using Measure = std::optional<double> Measures::*;

/// The measures without which nothing is said, and those that count where they were taken.
constexpr Measure kNeeded[] = {
    &Measures::displacement_mm, &Measures::mirror_ratio,    &Measures::mirror_advantage,
    &Measures::rival_ratio,     &Measures::rival_advantage, &Measures::parts_mm,
    &Measures::local_agreement, &Measures::local_advantage, &Measures::tissue_motion_mm};
constexpr Measure kUsedIfMeasured[] = {&Measures::expected_error_mm, &Measures::mirror_agreement,
                                       &Measures::ridge_parts_mm, &Measures::wide_motion_mm};

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

/// Halves of the field that move a pose by this much, by either of their similarities, leave it
/// uncertain by almost 5 mm, whatever the rest says: the log odds fall by kTornPerMm for every mm
/// beyond. The limit is a matter of reason: of 581 right poses one is refused by it.
constexpr double kTornMm = 4.0;
constexpr double kMostTornMm = 4.0;
constexpr double kTornPerMm = 2.0;

/// Blocks that agree less than this speak against the pose, whatever else is known, and the log
/// odds fall by kPerTooLittleAgreement times what is missing. Only what blocks of mirror images
/// reach says more: noise and a low contrast let blocks agree little at the right pose (0.12 to
/// 0.24 in kidneys of a real CT), but those of mirror images then agree as little as chance gives.
constexpr double kLeastAgreement = 0.24;
constexpr double kPerTooLittleAgreement = 30.0;

/// The share of the agreement that no mirror image reaches is not taken of less agreement than
/// this.
constexpr double kLeastToShare = 0.05;
/// Many blocks are sure together only where mirror images reach less than half of the agreement:
/// the log odds fall by kPerTooLittleShare times what is missing. Right poses that nothing else
/// saves have had shares of 0.60 and more.
constexpr double kLeastShare = 0.5;
constexpr double kPerTooLittleShare = 20.0;
/// The gain of many blocks is no surer than at this many standard errors: that of another patient's
/// kidney has reached 8.3.
constexpr double kSureAdvantage = 8.0;

/// Many blocks that are sure together may be moved by noise, which wider groups of them are not.
/// These see less of a motion of tissue, too: so much is added to what they see, by reason.
constexpr double kUnseenMm = 0.4;
/// Wider groups begin to count where blocks gain so many standard errors together, and count in
/// full at one more: in small fields they lie still in kidneys of other patients, whose blocks have
/// gained 3.2 to 5.6.
constexpr double kSureTogether = 5.0;

/// No evidence of one kind is so strong that it makes up for any weakness of the other.
constexpr double kMostChanceOdds = 4.0;
constexpr double kMostAnatomyOdds = 3.0;
/// Beside the anatomy, standing out from chance counts for no more log odds than this: the kidney
/// of another patient stands out from chance as well.
constexpr double kMostChanceBesideAnatomy = 1.0;

/// Poses farther off are wrong.
constexpr double kWrongMm = 5.0;

/// The comparison with mirror images, within the range in which the calibration has seen it. The
/// last two are by how much more clusters agree with the pose than those of any mirror image, and
/// the share of their agreement that this is.
struct MirrorComparison {
  double log_ratio;
  double advantage;
  std::optional<double> agreement;
  double share = 0.0;
};
MirrorComparison mirror_comparison(const Measures& m) {
  MirrorComparison compared{
      log_within(*m.mirror_ratio, 0.7, 2.5), std::clamp(*m.mirror_advantage, -3.0, 6.0), {}};
  if (!m.mirror_agreement) return compared;
  const double more = *m.local_agreement - *m.mirror_agreement;
  compared.agreement = std::clamp(more, -0.3, 0.3);
  compared.share = std::clamp(more / std::max(*m.local_agreement, kLeastToShare), -1.0, 1.0);
  return compared;
}

/// The log odds that the ultrasound is not one of its mirror images. Where these fit almost as
/// well, agreement can still tell them apart.
double mirrors_log_odds(const MirrorComparison& mirrors) {
  const double by_fit = -0.8 + 4.0 * mirrors.log_ratio + 1.55 * mirrors.advantage;
  if (!mirrors.agreement) return by_fit;
  return std::max(by_fit, -3.0 + 0.9 * mirrors.advantage + 40.0 * *mirrors.agreement);
}

/// The motion of tissue without what noise adds to it in small groups of blocks.
double motion_without_noise_mm(const Measures& m) {
  const double small_mm = *m.tissue_motion_mm;
  if (!m.wide_motion_mm) return small_mm;
  const double sure = std::clamp(*m.local_advantage - kSureTogether, 0.0, 1.0);
  return small_mm + sure * (std::min(small_mm, *m.wide_motion_mm + kUnseenMm) - small_mm);
}

/// The log odds that the CT shows this anatomy, by how far blocks agree, before mirror images were
/// asked.
double log_odds_by_agreement(const Measures& m, const MirrorComparison& mirrors) {
  const double agreement = *m.local_agreement;
  const double together = -11.3 + 30.0 * agreement - 2.75 * *m.tissue_motion_mm +
                          4.6 * mirrors.log_ratio + 1.8 * mirrors.advantage;
  return std::min(together, kPerTooLittleAgreement * (agreement - kLeastAgreement));
}

/// The same once they were asked: the higher of two. Few blocks may agree much more than those of
/// mirror images, and need not move. Where noise, a low contrast or tissue that has moved leave
/// little agreement, many blocks may still be sure together, and mirror images have next to none.
double log_odds_by_mirror_agreement(const Measures& m, const MirrorComparison& mirrors) {
  const double by_agreement = 1.8 + 3.5 * *m.local_agreement - 3.3 * *m.tissue_motion_mm +
                              0.2 * mirrors.advantage + 32.0 * *mirrors.agreement;
  const double by_many_blocks = -2.9 + 0.88 * std::clamp(*m.local_advantage, -3.0, kSureAdvantage) -
                                2.5 * motion_without_noise_mm(m) + 6.0 * mirrors.share -
                                kPerTooLittleShare * std::max(0.0, kLeastShare - mirrors.share);
  return std::max(by_agreement, by_many_blocks);
}

/// The log odds that the CT shows the anatomy that is in the ultrasound, and not a like one.
double anatomy_log_odds(const Measures& m, const MirrorComparison& mirrors) {
  const double together = mirrors.agreement ? log_odds_by_mirror_agreement(m, mirrors)
                                            : log_odds_by_agreement(m, mirrors);
  const double torn = kTornPerMm * std::clamp(halves_motion_mm(m) - kTornMm, 0.0, kMostTornMm);
  return std::min(together, kMostAnatomyOdds) - torn;
}

/// The probability that a normally distributed error in space, the same in all directions, is
/// shorter than kWrongMm (Maxwell's distribution).
double probability_near(double rms_mm) {
  const double ratio = kWrongMm / std::max(rms_mm, 1e-3);
  return boost::math::gamma_p(1.5, 1.5 * ratio * ratio);
}

/// The first measure that the probability cannot be computed with.
std::optional<Measure> first_unusable(const Measures& m) {
  for (const Measure measure : kNeeded)
    if (!(m.*measure) || std::isnan(*(m.*measure))) return measure;
  for (const Measure measure : kUsedIfMeasured)
    if (m.*measure && std::isnan(*(m.*measure))) return measure;
  return std::nullopt;
}

std::string name_of(Measure measure) {
  const auto& fields = measure_fields();
  return std::find_if(fields.begin(), fields.end(),
                      [&](const MeasureField& field) { return field.value == measure; })
      ->name;
}

}  // namespace

double halves_motion_mm(const Measures& measures) {
  return std::max(*measures.parts_mm, measures.ridge_parts_mm.value_or(0.0));
}

double RightProbability::all() const {
  const double counts = std::min(chance, logistic(kMostChanceBesideAnatomy));
  const double against = (1.0 - counts) * (1.0 - anatomy);
  return mirrors * near * counts * anatomy / (counts * anatomy + against);
}

std::optional<RightProbability> right_probability(const Measures& m) {
  if (first_unusable(m)) return std::nullopt;
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

std::string missing_evidence(const Measures& measures) {
  const bool is_gathered =
      std::any_of(std::begin(kNeeded), std::end(kNeeded), [&](const Measure measure) {
        return measure != &Measures::displacement_mm && measures.*measure;
      });
  if (!is_gathered) return "none was gathered";
  const std::optional<Measure> missing = first_unusable(measures);
  if (!missing) return "";
  return name_of(*missing) +
         " could not be measured, since the ultrasound has too few samples that count and lie in "
         "the CT";
}

std::optional<double> wrong_probability(const Measures& measures) {
  const std::optional<RightProbability> right = right_probability(measures);
  if (!right) return std::nullopt;
  return 1.0 - right->all();
}

}  // namespace usct
