#include "registration/attempts/verdict.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "registration/evidence/acquisition_check.h"
#include "registration/evidence/decoys.h"
#include "ultrasound/stray_frames.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct::registration {
namespace {

std::string number(double value) { return formatted("%.2g", value); }

std::string mirrored_words(Mirror mirror) {
  switch (mirror) {
    case Mirror::kLines:
      return "its lines in reverse order";
    case Mirror::kFrames:
      return "its frames in reverse order";
    case Mirror::kHalfTurn:
      return "the probe turned by half a turn";
    case Mirror::kCtAxis1:
      return "the first axis of the CT reversed";
    case Mirror::kCtAxis2:
      return "the second axis of the CT reversed";
    case Mirror::kCtAxis3:
      return "the third axis of the CT reversed";
    case Mirror::kCtAxes12:
      return "the first and second axes of the CT exchanged";
    case Mirror::kCtAxes13:
      return "the first and third axes of the CT exchanged";
    case Mirror::kCtAxes23:
      return "the second and third axes of the CT exchanged";
  }
  return "";
}

/// Whether mirrored ultrasound is clearly better, which names the fault.
bool is_mirrored(const Measures& m) { return *m.mirror_ratio < 1.0 && *m.mirror_advantage < 0.0; }

/// Why a pose that is no better than mirrored ultrasound is not believed.
std::string mirror_words(const Assessment& assessment) {
  const Measures& m = assessment.measures;
  const std::string which = mirrored_words(*assessment.best_mirror);
  if (is_mirrored(m))
    return "the ultrasound fits the CT better with " + which + " (" +
           number(1.0 / *m.mirror_ratio) + " times the similarity): check " +
           (is_of_ct(*assessment.best_mirror)
                ? "the order and the directions of the axes in the CT's file"
                : "which way round the probe was held, the order of lines and frames in the file, "
                  "and whether the CT is mirrored");
  const std::string alike = "the ultrasound fits the CT about as well with " + which +
                            " (the found pose has " + number(*m.mirror_ratio) +
                            " times that similarity): the anatomy in view is nearly symmetric, ";
  if (is_of_ct(*assessment.best_mirror))
    return alike +
           "so that it does not show which way the axes of the CT run; check their order and "
           "directions in the CT's file, or acquire a larger field of view";
  return alike + "or the CT is not of this patient; a larger field of view would help";
}

std::string chance_words(const Measures& m) {
  if (*m.rival_ratio < *m.chance_ratio)
    return "a pose elsewhere fits almost as well (the found pose has " + number(*m.rival_ratio) +
           " times its similarity): give an initial pose that is closer, or acquire a larger field "
           "of view";
  return "the best pose is hardly better than chance (" + number(*m.chance_ratio) +
         " times the similarity that mirrored ultrasound reaches): the CT may be of another "
         "patient, the kidney may not be in view, or the initial pose may be too far off";
}

std::string anatomy_words(const Measures& m) {
  return "the ultrasound fits as it may fit another anatomy that is alike (small blocks of the "
         "field "
         "agree with the pose by " +
         number(*m.local_agreement) +
         ", where 1 is full agreement and 0 is chance; tissue in the middle would rather lie " +
         number(*m.tissue_motion_mm) + " mm elsewhere; halves of the field move the pose by " +
         number(halves_motion_mm(m)) + " mm; it has " + number(*m.mirror_ratio) +
         " times the similarity of its best mirror image): the CT may be of another patient, or "
         "the anatomy may be deformed or may have moved "
         "during the sweep; check whose CT it is, probe geometry and tracking, and acquire again "
         "during a breath hold";
}

std::string near_words(const Measures& m) {
  std::string words = "an error of more than 5 mm is not improbable (expected are " +
                      number(*m.expected_error_mm) + " mm";
  if (shown_errors(m).has_wrong_depths()) return words + "), since the recorded depths are wrong";
  if (m.tissue_motion_mm)
    words += "; tissue in the middle of the field would rather lie " + number(*m.tissue_motion_mm) +
             " mm elsewhere";
  return words +
         "): the anatomy may have moved or be deformed since the CT; acquire again during a breath "
         "hold and with little pressure, and check probe geometry and tracking";
}

std::string percent(double error) { return number(100.0 * std::abs(error)) + " %"; }

/// The place of the frames with these errors of the sweep, and what to check.
std::string sweep_words(const AcquisitionErrors& errors) {
  constexpr double kAlike = 0.02;
  const auto apart = [](double error) {
    return percent(error) + (error > 0.0 ? " farther apart" : " closer together");
  };
  std::string words = apart(errors.sweep);
  if (std::abs(errors.unevenness) > kAlike)
    words = apart(errors.sweep - errors.unevenness) + " before the middle of the sweep and " +
            apart(errors.sweep + errors.unevenness) + " after it";
  return words + ": check the motor's step in the probe file, or the tracking of the probe";
}

/// A fault of the recorded geometry that the images show, as a sentence to append; empty if none.
std::string acquisition_words(const Measures& m) {
  std::string words;
  const ShownErrors shown = shown_errors(m);
  if (shown.has_wrong_depths())
    words += "; the ultrasound fits better if its depths are " + percent(shown.errors.depth) +
             (shown.errors.depth > 0.0 ? " larger" : " smaller") +
             ": check depth and sample spacing in the probe file, and the speed of sound";
  if (shown.has_wrong_sweep())
    words += "; the ultrasound fits better if its frames lie " + sweep_words(shown.errors);
  return words;
}

/// Says what was found, why it is not believed and what would help. A mirrored acquisition is named
/// first, since parts of the field do not agree about its pose either; else the weakest kind of
/// evidence gives the reason.
std::string explanation(const Assessment& assessment) {
  const std::optional<RightProbability> right = right_probability(assessment.measures);
  if (!right) return "there is no evidence for it: " + missing_evidence(assessment.measures);
  const double least = std::min({right->mirrors, right->chance, right->anatomy, right->near});
  if (least == right->mirrors || is_mirrored(assessment.measures)) return mirror_words(assessment);
  if (least == right->chance) return chance_words(assessment.measures);
  if (least == right->anatomy) return anatomy_words(assessment.measures);
  return near_words(assessment.measures);
}

}  // namespace

RegistrationResult result_of(const Judged& judged) {
  const auto& [optima, refined, assessment, failure] = judged;
  RegistrationResult result;
  result.similarity = optima.front().value;
  result.overlap = refined.overlap;
  result.covariance = assessment.covariance;
  result.measures = assessment.measures;
  // The first candidate is the pose that is judged, after its refinement.
  result.candidates.push_back({refined.T_us_ct, optima.front().value, refined.overlap});
  for (std::size_t i = 1; i < optima.size(); ++i)
    result.candidates.push_back({optima[i].T_us_ct, optima[i].value, optima[i].overlap});
  if (failure) {
    result.status =
        failure->no_overlap ? RegistrationStatus::kNoOverlap : RegistrationStatus::kLowConfidence;
    result.message = failure->message;
    if (!failure->no_overlap) result.message += ": " + explanation(assessment);
  } else {
    result.status = RegistrationStatus::kRegistered;
    result.message = "all gates passed";
    result.T_us_ct = refined.T_us_ct;
  }
  if (!failure || !failure->no_overlap) result.message += acquisition_words(assessment.measures);
  return result;
}

void tell_corrected_sweep(const AcquisitionErrors& errors, RegistrationResult& result) {
  if (!errors.any()) return;
  Measures& measures = result.measures;
  measures.sweep_error = errors.sweep + measures.sweep_error.value_or(0.0);
  measures.sweep_unevenness = errors.unevenness + measures.sweep_unevenness.value_or(0.0);
  result.message += "; the frames were taken to lie " + sweep_words(errors);
}

void tell_stray_frames(const std::vector<int>& frames, int of_frames, RegistrationResult& result) {
  result.message += "; " + stray_words(frames, of_frames) + ": they were left out";
}

RegistrationResult result_of(const Refusal& refusal) {
  RegistrationResult result;
  result.status = refusal.status;
  result.message = refusal.message;
  return result;
}

}  // namespace usct::registration
