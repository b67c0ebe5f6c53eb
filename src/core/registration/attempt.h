#pragma once

#include <optional>
#include <vector>

#include "registration/assessment.h"
#include "registration/input.h"
#include "registration/trail.h"

/// One attempt to register: search, refine, assess and judge on one set of images.
namespace usct::registration {

/// A registration, and what it leaves for the next one.
struct Registration {
  RegistrationResult result;
  /// A full registration leaves one if it was accepted and has evidence on its own images.
  std::optional<Trail> trail;
  /// Whether the registration went on as the preset `patient`.
  bool by_patient = false;
  /// Whether matched blocks found the pose: `similarity` is then that of their search.
  bool by_blocks = false;
  /// Whether the pose was tracked, without a search.
  bool was_tracked = false;
};

class Attempt {
 public:
  /// `images` are those that `prepare` makes of the input. They must outlive the attempt.
  Attempt(const RegistrationInput& input, const ImagePyramid& images, Run& run);
  /// An attempt by another search on these images.
  Attempt(const RegistrationInput& input, const ImagePyramid& images, const SearchProblem& search,
          Run& run);

  /// Each round searches, refines, assesses and judges, until the pose passes the gates, or the
  /// evidence says that another round would not help. After the first round blocks of the
  /// ultrasound are matched, see BlockSearch; their pose is the result if it passes, or if no pose
  /// does and it is less likely to be wrong.
  Outcome<Registration> search();
  /// The pose of the first round, if it is to be believed without further search.
  std::optional<Registration> at_once();
  /// The pose of one round, whether it is believed or not; none if blocks of the field agree so
  /// little about it that it cannot be.
  std::optional<Registration> in_one_round();
  /// The pose that the trail leads to, if it is to be believed without a search.
  std::optional<Registration> tracked(const Lead& lead);

 private:
  /// The pose that was judged.
  struct Judged {
    Candidate refined;
    Assessment assessment;
    std::optional<GateFailure> failure;
  };

  std::optional<Registration> by_blocks() const;
  Assessor assessor() const { return Assessor(in_, images_, problem_); }
  std::vector<Candidate> searched(int round, std::vector<Candidate> found);
  Assessment compared(Assessor& assessor, const std::vector<Candidate>& optima);
  /// Refines and judges the best optimum, which so many rounds have found.
  Outcome<Judged> refine_and_judge(Assessor& assessor, std::vector<Candidate>& optima,
                                   const Assessment& compared, int rounds);
  /// Judges the best optimum after its refinement. If that led to another optimum, that one becomes
  /// the first, and the evidence is gathered for it.
  Outcome<Judged> judge_where_it_led(Assessor& assessor, std::vector<Candidate>& optima,
                                     const Assessment& compared, const Candidate& refined);
  /// The optimum that the refined pose leads to, if it is another than the one that was refined.
  std::optional<Candidate> other_optimum(const Candidate& optimum, const Candidate& refined);
  bool has_left(const Candidate& optimum, const Candidate& refined) const;
  Outcome<Judged> judge_refined(Assessor& assessor, const std::vector<Candidate>& optima,
                                const Assessment& compared, const Candidate& refined);
  /// The same beside decoys of so many rounds at least, which climb from the pose too.
  Outcome<Judged> judge_beside_more(Assessor& assessor, const std::vector<Candidate>& optima,
                                    const Candidate& refined, int rounds);
  /// As long as the pose is refused, goes on to where blocks of the field would rather lie
  /// together, if they agree more there; so many rounds have found `optima`. Climbs of the whole
  /// field end at a wrong optimum near the right pose, which blocks by themselves still see.
  void follow_blocks(Assessor& assessor, std::vector<Candidate>& optima, Judged& best, int rounds);
  /// The optimum that is climbed to from there, if it is another pose.
  std::optional<Candidate> wished_optimum(const Judged& judged);
  bool is_another_pose(const Eigen::Isometry3d& T_us_ct, const Judged& judged) const;
  /// Whether it passes the gates, and the registration does not go on as `patient` for it.
  bool is_believed(const Judged& judged) const;
  Registration ended(const Assessor& assessor, const std::vector<Candidate>& optima,
                     const Judged& judged) const;

  const RegistrationInput in_;
  const ImagePyramid& images_;
  Run& run_;
  const EvidencePlan plan_;
  const SearchProblem problem_;
};

}  // namespace usct::registration
