#include "registration/pipeline.h"

#include "registration/as_patient.h"
#include "registration/attempts/judged_as_patient.h"
#include "registration/attempts/rounds.h"
#include "registration/attempts/verdict.h"
#include "registration/evidence/acquisition_check.h"
#include "registration/evidence_plan.h"
#include "registration/sweep_correction.h"
#include "ultrasound/resting_frames.h"
#include "ultrasound/stray_frames.h"
#include "ultrasound/sweep_motion.h"

namespace usct::registration {
namespace {

/// How far a registration has come when its images are prepared, and when a pose in doubt is left
/// to the preset `patient`.
constexpr double kPrepared = 0.2;
constexpr double kLeft = 0.6;

Outcome<ImagePyramid> prepared(const RegistrationInput& input, Run& run) {
  const Run::Part part(run, 0.0, kPrepared);
  return prepare(input, run);
}

/// The registration by the search of these options, or nothing where they leave it to the preset
/// `patient`.
Outcome<std::optional<Registration>> by_own_search(const RegistrationInput& input, const Lead* lead,
                                                   Run& run) {
  run.report(0.0);
  const Outcome<ImagePyramid> images = prepared(input, run);
  if (!images) return images.refusal();
  const Run::Part part(run, kPrepared, 1.0);
  run.report(0.0);
  const Attempt attempt = attempt_on(*images, input, run);
  const EvidencePlan plan(input.options.confidence);
  const bool has_own_evidence = !plan.is_judged_as_patient();
  if (lead != nullptr && has_own_evidence)
    if (std::optional<Registration> found = tracked(attempt, *lead)) return found;
  if (plan.may_go_on_as_patient()) return at_once(attempt);
  const Outcome<Registration> found =
      has_own_evidence ? in_rounds(attempt) : judged_as_patient(attempt);
  if (!found) return found.refusal();
  return std::optional(*found);
}

/// The registration of the ultrasound as it was recorded.
Outcome<Registration> registered(const RegistrationInput& input, const Lead* lead, Run& run) {
  Outcome<std::optional<Registration>> found = by_own_search(input, lead, run);
  if (!found) return found.refusal();
  if (*found) return **found;
  const Run::Part part(run, kLeft, 1.0);
  const RegistrationOptions patient = as_patient(input.options);  // they leave nothing to others
  found = by_own_search(input.by(patient), nullptr, run);
  if (!found) return found.refusal();
  (*found)->by_patient = true;
  return **found;
}

/// The registration of the ultrasound without these errors of its sweep.
Outcome<Registration> registered_without(const AcquisitionErrors& errors,
                                         const RegistrationInput& input, const Lead* lead,
                                         Run& run) {
  // Frames at rest would stay behind when the sweep is stretched.
  const std::optional<BeamUltrasound> moving = without_resting_frames(input.ultrasound);
  const BeamUltrasound& recorded = moving ? *moving : input.ultrasound;
  const BeamUltrasound corrected{with_sweep(recorded.beams, errors), recorded.brightness,
                                 recorded.known};
  return registered(input.on(corrected), lead, run);
}

/// Says that these errors were taken out of the ultrasound.
Registration corrected_by(const AcquisitionErrors& errors, Registration registration) {
  tell_corrected_sweep(errors, registration.result);
  if (registration.trail) registration.trail->corrected = errors;
  return registration;
}

/// The registration of ultrasound with its frames where its images show that they lie, if that is
/// elsewhere than recorded. Where the images do not confirm that, the result is that of the
/// ultrasound as it was recorded.
Outcome<Registration> registered_on_shown_sweep(const RegistrationInput& input, const Lead* lead,
                                                Run& run) {
  // A lead tells the errors at once, unless the motor now moves otherwise: on its way back the slow
  // side is the other one.
  if (lead != nullptr && lead->trail.corrected.any()) {
    const AcquisitionErrors& known = lead->trail.corrected;
    const Outcome<Registration> found = registered_without(known, input, lead, run);
    if (shows_right_sweep(found)) return corrected_by(known, *found);
    return registered_on_shown_sweep(input, nullptr, run);
  }
  const Outcome<Registration> found = registered(input, lead, run);
  if (!found) return found.refusal();
  const ShownErrors shown = shown_errors(found->result.measures);
  if (!input.options.correct_sweep || !shown.has_wrong_sweep() || !shown.are_of_sweep_alone())
    return *found;
  const AcquisitionErrors errors{0.0, shown.errors.sweep, shown.errors.unevenness};
  // A pose that is right but for the sweep is found in the first round of its registration.
  RegistrationOptions in_one_round = input.options;
  in_one_round.search.rounds = 1;
  const Outcome<Registration> again =
      registered_without(errors, input.by(in_one_round), nullptr, run);
  if (correction_holds(*found, again)) return corrected_by(errors, *again);
  return *found;
}

/// The registration of the frames whose poses can be right.
Outcome<Registration> registered_on_path(const RegistrationInput& input, const Lead* lead,
                                         Run& run) {
  const FramesOnPath frames = frames_on_path(input.ultrasound);
  if (!frames.others) return registered_on_shown_sweep(input, lead, run);
  Outcome<Registration> found = registered_on_shown_sweep(input.on(*frames.others), lead, run);
  if (!found) return found.refusal();
  tell_stray_frames(frames.stray, input.ultrasound.beams.frames, found->result);
  return found;
}

}  // namespace

Registration run_pipeline(const RegistrationInput& input, const RegistrationHooks& hooks,
                          const Lead* lead) {
  Run run(hooks);
  Registration ended;
  try {
    Outcome<Registration> outcome = registered_on_path(input, lead, run);
    if (outcome) run.report_end();
    ended = outcome ? std::move(*outcome) : Registration{result_of(outcome.refusal()), {}};
  } catch (const Cancelled&) {
    ended = {result_of(Refusal{RegistrationStatus::kCancelled, "cancelled by the caller"}), {}};
  }
  ended.result.evaluations = run.evaluations();
  ended.result.seconds = run.seconds();
  ended.result.version = USCT_VERSION;
  return ended;
}

}  // namespace usct::registration
