#pragma once

#include <optional>
#include <vector>

#include "registration/attempts/attempt.h"
#include "registration/attempts/judged.h"
#include "registration/evidence_plan.h"

/// The steps assess and judge, by evidence from the images of the attempt.
namespace usct::registration {

/// Keeps from pose to pose the mirror images that poses of one attempt are compared with.
class PoseJudge {
 public:
  /// The attempt must outlive it, and not be one whose poses are judged as `patient` judges them:
  /// see EvidencePlan.
  explicit PoseJudge(const Attempt& attempt);

  /// As Evidence.
  const std::optional<std::vector<Decoy>>& decoys() const { return evidence_.decoys(); }
  void take_over(std::vector<Decoy> decoys) { evidence_.take_over(std::move(decoys)); }

  /// Whether blocks of the field agree about a pose so surely that it is worth the search for
  /// mirror images.
  bool blocks_agree(const Candidate& refined);
  /// Compares the first of the optima of the search with mirrored ultrasound and with its rivals;
  /// with `decoy_rounds`, as Evidence::compare_further.
  Assessment compared(const std::vector<Candidate>& optima,
                      const std::optional<int>& decoy_rounds = std::nullopt);
  /// Whether a pose that was compared is worth its refinement. It is not if it would be refused
  /// even if all parts of the field agreed about it, and another round could find a better one; or
  /// would even then be in doubt, and the registration would go on as `patient`.
  bool parts_could_save(const Assessment& compared) const;

  /// Judges the first of the optima after its refinement; `compared` is what was made of them.
  Judged judged(std::vector<Candidate> optima, Assessment compared, const Candidate& refined);
  /// The same. If the refinement led to another optimum, that one becomes the first, and the
  /// evidence is gathered for it.
  Judged judged_where_it_led(std::vector<Candidate> optima, const Assessment& compared,
                             const Candidate& refined);
  /// Refines the best optimum, which so many rounds have found, and judges it where that led.
  Outcome<Judged> refined_and_judged(const std::vector<Candidate>& optima,
                                     const Assessment& compared, int rounds);
  /// Goes on from a refused pose to where blocks of the field would rather lie together, as long as
  /// they agree more there; so many rounds have found its optima. Climbs of the whole field end at
  /// a wrong optimum near the right pose, which blocks by themselves still see.
  Judged follow_wished_motion(Judged refused, int rounds);

  /// Whether the refinement led away from an optimum.
  bool has_left(const Candidate& optimum, const Candidate& refined) const;
  /// Whether it passes the gates, and the registration does not go on as `patient` for it.
  bool is_believed(const Judged& judged) const;

 private:
  bool goes_on_as_patient(const Measures& measures) const;
  /// Judges beside decoys of so many rounds at least, which climb from the pose too.
  Judged judged_beside_more(std::vector<Candidate> optima, const Candidate& refined, int rounds);
  /// The optimum that the refined pose leads to, if it is another than the one that was refined.
  std::optional<Candidate> other_optimum(const Candidate& optimum, const Candidate& refined) const;
  /// One step of `follow_wished_motion`; none if it does not lead on.
  std::optional<Judged> one_step_on(const Judged& refused, int rounds);
  /// The optimum that is climbed to from where blocks would rather lie, if it is another pose.
  std::optional<Candidate> wished_optimum(const Judged& judged) const;
  bool is_another_pose(const Eigen::Isometry3d& T_us_ct, const Judged& judged) const;

  const Attempt& attempt_;
  const EvidencePlan plan_;
  Evidence evidence_;
};

}  // namespace usct::registration
