#include "registration/evidence/doubts.h"

#include <limits>

#include "us_ct_registration/registration/right_probability.h"

namespace usct::registration {

bool is_beyond_doubt(const Measures& measures, double limit) {
  constexpr double kShareOfLimit = 0.1;
  // With mirrored CTs of nearly symmetric kidneys that left no other doubt, blocks have agreed by
  // 0.33 to 0.36. They agree by less than 0.4 at one in twelve right poses that leave none.
  constexpr double kLeastAgreement = 0.4;
  // A CT with exchanged axes fitted no better than its mirror image, 0.99 and 1.00 times as well,
  // and left no other doubt. Right poses that leave none fit 1.06 times as well or better.
  constexpr double kLeastMirrorRatio = 1.05;
  const std::optional<double>& wrong = measures.wrong_probability;
  const std::optional<double>& agreement = measures.local_agreement;
  const std::optional<double>& mirror = measures.mirror_ratio;
  return wrong && *wrong <= kShareOfLimit * limit && agreement && *agreement >= kLeastAgreement &&
         mirror && *mirror >= kLeastMirrorRatio;
}

bool fits_mirrored(const Measures& measures) {
  constexpr double kMirrorFound = 0.6;
  constexpr double kMirrorSure = -4.0;
  return right_probability(measures) && *measures.mirror_ratio < kMirrorFound &&
         *measures.mirror_advantage < kMirrorSure;
}

bool may_be_missed(const Measures& measures) {
  if (!right_probability(measures)) return true;
  if (fits_mirrored(measures)) return false;
  // Mirror images say whether a pose should be believed. They do not say whether a better pose
  // exists, so they do not count here.
  Measures firm = measures;
  firm.mirror_ratio = firm.mirror_advantage = std::numeric_limits<double>::infinity();
  firm.mirror_agreement.reset();
  const std::optional<RightProbability> right = right_probability(firm);
  return right->chance < 0.5 || right->anatomy < 0.5;
}

bool may_be_near(const Measures& measures) {
  const bool mirror_fits_better = measures.mirror_ratio && *measures.mirror_ratio < 1.0;
  const bool agree_by_chance = measures.local_agreement && *measures.local_agreement <= 0.0;
  return !mirror_fits_better && !agree_by_chance;
}

bool may_be_in_mirrored_ct(const Measures& measures, bool lacks_a_side, double limit) {
  // If a mirror image fits almost as well, the anatomy in view is nearly symmetric: it then fits a
  // mirrored CT almost as well too. Two thirds of a kidney have fitted a CT with exchanged axes 1.6
  // times as well as their mirror images.
  constexpr double kAlmostAsWell = 1.3;
  return lacks_a_side || !is_beyond_doubt(measures, limit) ||
         *measures.mirror_ratio < kAlmostAsWell;
}

Measures if_parts_agree(const Measures& measures) {
  Measures best = measures;
  best.parts_mm = best.ridge_parts_mm = 0.0;
  best.tissue_motion_mm = best.wide_motion_mm = 0.0;
  best.local_agreement = 1.0;
  best.local_advantage = std::numeric_limits<double>::infinity();
  best.wrong_probability = wrong_probability(best);
  return best;
}

Measures if_no_mirror_agrees(const Measures& measures) {
  Measures best = measures;
  best.mirror_agreement = -1.0;
  best.wrong_probability = wrong_probability(best);
  return best;
}

std::optional<Measures> doubted_for_mirrored_ct(const Measures& measures, double ratio,
                                                double advantage) {
  Measures doubted = measures;
  doubted.mirror_ratio = ratio;
  doubted.mirror_advantage = advantage;
  // Blocks have agreed more at a pose in a CT with exchanged axes than at the right one.
  doubted.mirror_agreement.reset();
  doubted.wrong_probability = wrong_probability(doubted);
  if (doubted.wrong_probability <= measures.wrong_probability) return std::nullopt;
  return doubted;
}

}  // namespace usct::registration
