#include "us_ct_registration/registration/registration.h"

#include "registration/assessment.h"
#include "registration/image_pyramid.h"
#include "registration/multi_start.h"
#include "registration/refinement.h"
#include "registration/verdict.h"

namespace usct {
namespace {

using namespace registration;

/// The pipeline prepares the images once; each round then searches, refines, assesses and judges,
/// until the pose passes the gates, or the evidence says that another round would not help.
Outcome<RegistrationResult> run_pipeline(const BeamUltrasound& us, const PreparedCt& ct,
                                         const Eigen::Isometry3d& T_us_ct_initial,
                                         const RegistrationOptions& options, Run& run) {
  run.report(0.0);
  Outcome<ImagePyramid> images = prepare(us, ct, T_us_ct_initial, options, run);
  if (!images) return images.refusal();
  run.report(0.2);
  const SearchProblem problem{images->similarities(), options.search, T_us_ct_initial,
                              images->prepared.field, options.seed};
  Assessor assessor(us, ct.ct(), *images, problem, options);
  std::vector<Candidate> optima;
  for (int round = 0;; ++round) {
    optima =
        run.timed("search", [&] { return multi_start(problem, round, std::move(optima), run); });
    if (optima.empty())
      return Refusal{RegistrationStatus::kNoOverlap,
                     "no pose in reach has CT and ultrasound overlap"};
    const bool is_last = round + 1 == options.search.rounds.most;
    const Assessment compared =
        run.timed("confidence", [&] { return assessor.compare(optima, run); });
    run.report(0.2 + 0.8 * (round + 0.5) / options.search.rounds.most);
    if (!is_last && !assessor.parts_could_save(compared)) continue;
    const Outcome<Candidate> refined = refine(*images, ct, optima.front(), options, run);
    if (!refined) return refined.refusal();
    const Outcome<Assessment> assessment =
        run.timed("confidence", [&] { return assessor.assess(compared, optima, *refined, run); });
    if (!assessment) return assessment.refusal();
    const std::optional<GateFailure> failure =
        judge(assessment->measures, options.confidence.gates);
    run.report(0.2 + 0.8 * (round + 1) / options.search.rounds.most);
    if (!failure || is_last || !may_be_missed(*assessment))
      return result_of(optima, *refined, *assessment, failure);
  }
}

}  // namespace

RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                                       const Eigen::Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks) {
  Run run(hooks);
  RegistrationResult result;
  try {
    Outcome<RegistrationResult> outcome =
        run_pipeline(ultrasound, ct, T_us_ct_initial, options, run);
    if (outcome) run.report(1.0);
    result = outcome ? std::move(*outcome) : result_of(outcome.refusal());
  } catch (const Cancelled&) {
    result = result_of(Refusal{RegistrationStatus::kCancelled, "cancelled by the caller"});
  }
  result.evaluations = run.evaluations();
  result.seconds = run.seconds();
  result.version = USCT_VERSION;
  return result;
}

}  // namespace usct
