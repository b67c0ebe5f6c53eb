#include "us_ct_registration/registration/confidence_text.h"

#include <limits>

#include "us_ct_registration/formatted.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct {
namespace {

/// Evidence above this is strong; below one half it speaks against the pose.
constexpr double kStrong = 0.9;
constexpr double kEven = 0.5;

const char* direction_of(double probability) {
  if (probability < kEven) return "speaks against the pose";
  return probability < kStrong ? "does not decide" : "speaks for the pose";
}

/// One kind of evidence: how much it says, what was measured, and what would help if it is weak.
std::string line(const char* kind, double probability, const std::string& measured,
                 const char* help) {
  return formatted("  %s (%.2f) %s: ", kind, probability, direction_of(probability)) + measured +
         "\n" + (probability < kStrong ? std::string("    what would help: ") + help + "\n" : "");
}

std::string expected_error(const Measures& m) {
  if (!m.expected_error_mm) return "expected error: not known\n";
  std::string words =
      formatted("expected error in the middle of the field: %.2f mm", *m.expected_error_mm);
  if (m.error_bound_mm)
    words +=
        formatted("; below %.2f mm in 90 of 100 registrations that are right", *m.error_bound_mm);
  return words + "\n";
}

std::string agreement_of_mirrors(const Measures& m) {
  if (!m.mirror_agreement) return "";
  return formatted(
      "; small blocks of the field of view agree with the pose by %.2f, and with a mirror image by "
      "%.2f at most",
      *m.local_agreement, *m.mirror_agreement);
}

}  // namespace

std::string evidence_text(const Measures& m) {
  const std::optional<RightProbability> right = right_probability(m);
  if (!right) return "evidence: " + missing_evidence(m) + "\n";
  return "evidence, and the probability that the pose is right as far as each kind can tell:\n" +
         line("comparison with mirrored ultrasound", right->mirrors,
              formatted(
                  "the pose has %.2f times the similarity that its best mirror image reaches, "
                  "with lines or frames in reverse order, or axes of the CT reversed or exchanged "
                  "(patch by patch: t = %.1f)",
                  *m.mirror_ratio, *m.mirror_advantage) +
                  agreement_of_mirrors(m),
              "check which way round the probe was held, the order of lines and frames, and "
              "whether the CT is mirrored or its axes are exchanged; if the anatomy in view is "
              "symmetric, a larger field of "
              "view helps") +
         line(
             "comparison with chance", right->chance,
             formatted("the pose has %.2f times the similarity that chance reaches, and %.2f times "
                       "that of the best pose elsewhere (patch by patch: t = %.1f)",
                       m.chance_ratio.value_or(std::numeric_limits<double>::quiet_NaN()),
                       *m.rival_ratio, *m.rival_advantage),
             "check that the CT is of this patient and that the kidney is in view, and give an "
             "initial pose that is closer") +
         line("same anatomy", right->anatomy,
              formatted(
                  "small blocks of the field of view agree with the pose by %.2f, where 1 is "
                  "full agreement and 0 is chance (block by block: t = %.1f); tissue in the "
                  "middle would rather lie %.1f mm elsewhere; halves of the field, registered "
                  "alone, move the pose by %.1f mm; the comparison with mirrored ultrasound "
                  "counts here too",
                  *m.local_agreement, *m.local_advantage, *m.tissue_motion_mm, halves_motion_mm(m)),
              "check that the CT is of this patient, the geometry of the probe and the tracking, "
              "and acquire again during a breath hold and with little pressure") +
         // A small error is no evidence that the pose is right.
         (right->near < kStrong
              ? line("size of the error", right->near,
                     formatted("if the pose is right, its error is about %.1f mm, and below 5 mm "
                               "with this probability",
                               *m.expected_error_mm),
                     "acquire again during a breath hold and with little pressure")
              : "");
}

std::string confidence_text(const RegistrationResult& result) {
  if (result.candidates.empty()) return "";
  const Measures& m = result.measures;
  const std::string probability =
      m.wrong_probability ? formatted("probability that the pose is more than 5 mm off: %.3f\n",
                                      *m.wrong_probability)
                          : "probability that the pose is more than 5 mm off: not known\n";
  return probability + (result.T_us_ct ? expected_error(m) : evidence_text(m));
}

}  // namespace usct
