#include "registration/pipeline.h"

#include "registration/acquisition_check.h"
#include "registration/as_patient.h"
#include "registration/assessment.h"
#include "registration/image_pyramid.h"
#include "registration/multi_start.h"
#include "registration/refinement.h"
#include "registration/verdict.h"
#include "similarity/sweep_motion.h"

namespace usct::registration {
namespace {

/// The pose that was judged.
struct Judged {
  Candidate refined;
  Assessment assessment;
  std::optional<GateFailure> failure;
};

/// One registration on images that are prepared once.
class Pipeline {
 public:
  Pipeline(const BeamUltrasound& us, const PreparedCt& ct, const ImagePyramid& images,
           const Eigen::Isometry3d& T_us_ct_initial, const RegistrationOptions& options, Run& run)
      : us_(us),
        ct_(ct),
        images_(images),
        options_(options),
        run_(run),
        problem_{images.similarities(), options.search, T_us_ct_initial, images.prepared.field,
                 options.seed} {}

  /// Each round searches, refines, assesses and judges, until the pose passes the gates, or the
  /// evidence says that another round would not help.
  Outcome<PipelineResult> search();
  /// The pose of the first round, if it is to be believed without further search.
  std::optional<PipelineResult> at_once();
  /// The pose that the trail leads to, if it is to be believed without a search.
  std::optional<PipelineResult> tracked(const Trail& trail, double reach_mm);

 private:
  /// Refines and judges the best optimum, which so many rounds have found. If its refinement leads
  /// to another optimum, that one becomes the first, and the evidence is gathered for it.
  Outcome<Judged> judged(Assessor& assessor, std::vector<Candidate>& optima,
                         const Assessment& compared, int rounds);
  Outcome<Judged> judged(Assessor& assessor, const std::vector<Candidate>& optima,
                         const Assessment& compared, const Candidate& refined);
  bool has_left(const Candidate& optimum, const Candidate& refined) const;
  /// The same pose, judged beside decoys of so many rounds at least, which climb from it too.
  Outcome<Judged> judged_again(Assessor& assessor, const std::vector<Candidate>& optima,
                               const Candidate& refined, int rounds);
  /// Whether it passes the gates; beyond doubt, where doubts would be settled as `patient` does.
  bool is_believed(const Judged& judged) const;
  PipelineResult ended(const Assessor& assessor, const std::vector<Candidate>& optima,
                       const Judged& judged) const;
  std::optional<Trail> trail(const Assessor& assessor, const std::vector<Candidate>& optima,
                             const Judged& accepted) const;

  const BeamUltrasound& us_;
  const PreparedCt& ct_;
  const ImagePyramid& images_;
  const RegistrationOptions& options_;
  Run& run_;
  const SearchProblem problem_;
};

bool Pipeline::has_left(const Candidate& optimum, const Candidate& refined) const {
  return problem_.field.are_apart(optimum.T_us_ct, refined.T_us_ct, options_.search.distinct_mm);
}

Outcome<Judged> Pipeline::judged(Assessor& assessor, std::vector<Candidate>& optima,
                                 const Assessment& compared, int rounds) {
  const Outcome<Candidate> refined = refine(images_, ct_, optima.front(), options_, run_);
  if (!refined) return refined.refusal();
  bool is_another = false;
  if (assessor.gathers_own() && has_left(optima.front(), *refined)) {
    const Candidate reached = run_.timed("search", [&] {
      return optimum_near(problem_, refined->T_us_ct, options_.confidence.rival_mm, run_);
    });
    is_another = reached.has_value() && has_left(optima.front(), reached);
    if (is_another) optima = headed_by(reached, optima, problem_);
  }
  const Outcome<Judged> best = is_another ? judged_again(assessor, optima, *refined, 1)
                                          : judged(assessor, optima, compared, *refined);
  // More starts than the decoys had may have found a wrong pose that is better than they are.
  if (best && !best->failure && rounds > 1) return judged_again(assessor, optima, *refined, rounds);
  return best;
}

Outcome<Judged> Pipeline::judged(Assessor& assessor, const std::vector<Candidate>& optima,
                                 const Assessment& compared, const Candidate& refined) {
  const Outcome<Assessment> assessment =
      run_.timed("confidence", [&] { return assessor.assess(compared, optima, refined, run_); });
  if (!assessment) return assessment.refusal();
  return Judged{refined, *assessment, judge(assessment->measures, options_.confidence.gates)};
}

Outcome<Judged> Pipeline::judged_again(Assessor& assessor, const std::vector<Candidate>& optima,
                                       const Candidate& refined, int rounds) {
  assessor.search_decoys_further(rounds);
  const Assessment compared =
      run_.timed("confidence", [&] { return assessor.compare(optima, run_); });
  return judged(assessor, optima, compared, refined);
}

std::optional<Trail> Pipeline::trail(const Assessor& assessor, const std::vector<Candidate>& optima,
                                     const Judged& accepted) const {
  if (!assessor.gathers_own() || !assessor.decoys()) return std::nullopt;
  return trail_of(accepted.refined, *assessor.decoys(), optima, options_.confidence.rival_mm,
                  problem_.field);
}

bool Pipeline::is_believed(const Judged& judged) const {
  if (judged.failure) return false;
  return !may_go_on_as_patient(options_) ||
         is_beyond_doubt(judged.assessment.measures,
                         *options_.confidence.gates.max_wrong_probability);
}

PipelineResult Pipeline::ended(const Assessor& assessor, const std::vector<Candidate>& optima,
                               const Judged& judged) const {
  PipelineResult found{result_of(optima, judged.refined, judged.assessment, judged.failure), {}};
  if (!judged.failure) found.trail = trail(assessor, optima, judged);
  return found;
}

std::optional<PipelineResult> Pipeline::at_once() {
  Assessor assessor(us_, ct_, images_, problem_, options_);
  std::vector<Candidate> optima =
      run_.timed("search", [&] { return multi_start(problem_, 0, {}, run_); });
  if (optima.empty()) return std::nullopt;
  const Assessment compared =
      run_.timed("confidence", [&] { return assessor.compare(optima, run_); });
  run_.report(0.6);
  if (!assessor.parts_could_save(compared)) return std::nullopt;
  const Outcome<Judged> best = judged(assessor, optima, compared, 1);
  if (!best || !is_believed(*best)) return std::nullopt;
  return ended(assessor, optima, *best);
}

Outcome<PipelineResult> Pipeline::search() {
  Assessor assessor(us_, ct_, images_, problem_, options_);
  std::vector<Candidate> optima;
  std::optional<Eigen::Isometry3d> T_refused;
  for (int round = 0;; ++round) {
    optima =
        run_.timed("search", [&] { return multi_start(problem_, round, std::move(optima), run_); });
    if (optima.empty())
      return Refusal{RegistrationStatus::kNoOverlap,
                     "no pose in reach has CT and ultrasound overlap"};
    run_.report(0.2 + 0.8 * (round + 0.5) / options_.search.rounds);
    const bool is_last = round + 1 == options_.search.rounds;
    const Eigen::Isometry3d T_best = optima.front().T_us_ct;
    // Judged again, it would be refused again.
    if (!is_last && T_refused && T_refused->isApprox(T_best, 0.0)) continue;
    const Assessment compared =
        run_.timed("confidence", [&] { return assessor.compare(optima, run_); });
    if (!is_last && !assessor.parts_could_save(compared)) continue;
    const Outcome<Judged> best = judged(assessor, optima, compared, round + 1);
    if (!best) return best.refusal();
    run_.report(0.2 + 0.8 * (round + 1) / options_.search.rounds);
    if (is_last || !best->failure || !may_be_missed(best->assessment))
      return ended(assessor, optima, *best);
    T_refused = T_best;
  }
}

std::optional<PipelineResult> Pipeline::tracked(const Trail& trail, double reach_mm) {
  if (problem_.field.are_apart(problem_.T_us_ct_initial, trail.T_us_ct, reach_mm))
    return std::nullopt;
  const std::optional<Followed> followed = run_.timed("tracking", [&] {
    return follow(trail, problem_, images_.prepared.us->beams, options_.confidence, run_);
  });
  if (!followed) return std::nullopt;
  Assessor assessor(us_, ct_, images_, problem_, options_);
  assessor.take_over(followed->decoys);
  const Assessment compared =
      run_.timed("confidence", [&] { return assessor.compare(followed->optima, run_); });
  const Outcome<Candidate> refined = refine(images_, ct_, followed->optima.front(), options_, run_);
  if (!refined || has_left(followed->optima.front(), *refined)) return std::nullopt;
  const Outcome<Judged> best = judged(assessor, followed->optima, compared, *refined);
  if (!best || !is_believed(*best)) return std::nullopt;
  return PipelineResult{result_of(followed->optima, best->refined, best->assessment, best->failure),
                        {}};
}

/// The registration by the images of these options, or nothing where they leave it to those of the
/// preset `patient`.
Outcome<std::optional<PipelineResult>> by_own_images(const BeamUltrasound& us, const PreparedCt& ct,
                                                     const Eigen::Isometry3d& T_us_ct_initial,
                                                     const RegistrationOptions& options,
                                                     const Trail* trail, double reach_mm,
                                                     Run& run) {
  run.report(0.0);
  const Outcome<ImagePyramid> images = prepare(us, ct, T_us_ct_initial, options, run);
  if (!images) return images.refusal();
  run.report(0.2);
  Pipeline pipeline(us, ct, *images, T_us_ct_initial, options, run);
  if (trail != nullptr)
    if (std::optional<PipelineResult> tracked = pipeline.tracked(*trail, reach_mm)) return tracked;
  if (may_go_on_as_patient(options)) return pipeline.at_once();
  const Outcome<PipelineResult> found = pipeline.search();
  if (!found) return found.refusal();
  return std::optional(*found);
}

Outcome<PipelineResult> registered(const BeamUltrasound& us, const PreparedCt& ct,
                                   const Eigen::Isometry3d& T_us_ct_initial,
                                   const RegistrationOptions& options, const Trail* trail,
                                   double reach_mm, Run& run) {
  Outcome<std::optional<PipelineResult>> found =
      by_own_images(us, ct, T_us_ct_initial, options, trail, reach_mm, run);
  if (!found) return found.refusal();
  if (*found) return **found;
  constexpr double kCompared = 0.6;  // as far as a pose in doubt has come
  run.begin_part(kCompared, 1.0);
  found = by_own_images(us, ct, T_us_ct_initial, as_patient(options), nullptr, 0.0, run);
  if (!found) return found.refusal();
  (*found)->by_patient = true;
  return **found;
}

/// The registration of ultrasound with its frames where its images show that they lie, if that is
/// elsewhere than recorded. A trail tells it at once, unless the motor now moves otherwise: on its
/// way back the slow side is the other one. Where the pose on corrected ultrasound is not accepted,
/// the result is that of the ultrasound as it was before.
Outcome<PipelineResult> registered_on_shown_sweep(const BeamUltrasound& recorded,
                                                  const PreparedCt& ct,
                                                  const Eigen::Isometry3d& T_us_ct_initial,
                                                  const RegistrationOptions& options,
                                                  const Trail* trail, double reach_mm, Run& run) {
  const auto without = [&](const AcquisitionErrors& errors, const RegistrationOptions& how,
                           const Trail* followed) {
    if (!errors.any())
      return registered(recorded, ct, T_us_ct_initial, how, followed, reach_mm, run);
    const BeamUltrasound corrected{with_sweep(recorded.beams, errors), recorded.brightness,
                                   recorded.known};
    return registered(corrected, ct, T_us_ct_initial, how, followed, reach_mm, run);
  };
  const auto corrected_by = [](const AcquisitionErrors& errors, PipelineResult found) {
    tell_corrected_sweep(errors, found.result);
    if (found.trail) found.trail->corrected = errors;
    return found;
  };
  const AcquisitionErrors known = trail == nullptr ? AcquisitionErrors{} : trail->corrected;
  const Outcome<PipelineResult> found = without(known, options, trail);
  const auto is_accepted = [](const Outcome<PipelineResult>& outcome) {
    return outcome && outcome->result.status == RegistrationStatus::kRegistered;
  };
  if (known.any() && !is_accepted(found))
    return registered_on_shown_sweep(recorded, ct, T_us_ct_initial, options, nullptr, 0.0, run);
  if (!found) return found.refusal();
  const AcquisitionErrors shown =
      options.correct_sweep ? shown_sweep(found->result.measures) : AcquisitionErrors{};
  if (!shown.any()) return corrected_by(known, *found);
  const AcquisitionErrors errors{0.0, known.sweep + shown.sweep,
                                 known.unevenness + shown.unevenness};
  // A pose that is right but for the sweep is found in the first round of its registration.
  RegistrationOptions in_one_round = options;
  in_one_round.search.rounds = 1;
  const Outcome<PipelineResult> again = without(errors, in_one_round, nullptr);
  if (is_accepted(again)) return corrected_by(errors, *again);
  return corrected_by(known, *found);
}

}  // namespace

PipelineResult run_pipeline(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                            const Eigen::Isometry3d& T_us_ct_initial,
                            const RegistrationOptions& options, const RegistrationHooks& hooks,
                            const Trail* trail, double reach_mm) {
  Run run(hooks);
  PipelineResult ended;
  try {
    Outcome<PipelineResult> outcome =
        registered_on_shown_sweep(ultrasound, ct, T_us_ct_initial, options, trail, reach_mm, run);
    run.begin_part(0.0, 1.0);
    if (outcome) run.report(1.0);
    ended = outcome ? std::move(*outcome) : PipelineResult{result_of(outcome.refusal()), {}};
  } catch (const Cancelled&) {
    ended = {result_of(Refusal{RegistrationStatus::kCancelled, "cancelled by the caller"}), {}};
  }
  ended.result.evaluations = run.evaluations();
  ended.result.seconds = run.seconds();
  ended.result.version = USCT_VERSION;
  return ended;
}

}  // namespace usct::registration
