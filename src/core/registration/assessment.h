#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "registration/evidence/evidence.h"
#include "registration/evidence_plan.h"
#include "registration/outcome.h"

/// The step assess: which evidence is gathered for a pose, and what it says about the search.
namespace usct::registration {

class Assessor {
 public:
  /// `problem` is the search on `images`, which `prepare` has made of the input. The objects that
  /// the arguments refer to must outlive the assessor.
  Assessor(const RegistrationInput& input, const ImagePyramid& images,
           const SearchProblem& problem);
  ~Assessor();

  /// As Evidence.
  const std::optional<std::vector<Decoy>>& decoys() const { return own_.decoys(); }
  void take_over(std::vector<Decoy> decoys) { own_.take_over(std::move(decoys)); }
  void search_decoys_further(int rounds);

  /// Whether blocks of the field agree about a pose so surely that it is worth the search for
  /// mirror images.
  bool blocks_agree(const Candidate& pose, Run& run) { return own_.blocks_agree(pose, run); }
  /// Compares the best of the optima of the search, best first, with mirrored ultrasound and with
  /// its rivals, if the evidence comes from these images; that of others is left to `assess`.
  Assessment compare(const std::vector<Candidate>& optima, Run& run);
  /// Whether a pose that was compared is worth its refinement. It is not if it would be refused
  /// even if all parts of the field agreed about it, and another round could find a better one; or
  /// would even then be in doubt, and the registration would go on as `patient`.
  bool parts_could_save(const Assessment& compared) const;
  /// Completes what `compare` made of these optima; `refined` is the first one after its
  /// refinement. Refuses if the images of the evidence cannot be made.
  Outcome<Assessment> assess(Assessment compared, const std::vector<Candidate>& optima,
                             const Candidate& refined, Run& run);

 private:
  /// The images, the search and the evidence of the preset `patient`.
  struct AsPatient;

  /// The measures that need no evidence.
  void measure_pose(const Candidate& optimum, const Candidate& refined, Measures& measures) const;
  /// Gathers the evidence for a pose anew, as the preset `patient` does.
  std::optional<Refusal> assess_as_patient(const Candidate& refined, Assessment& assessment,
                                           Run& run);

  const RegistrationInput in_;
  const ImagePyramid& images_;
  const SearchProblem& problem_;
  const EvidencePlan plan_;
  Evidence own_;
  /// Made when it is needed, and kept from round to round.
  std::unique_ptr<AsPatient> as_patient_;
  int decoy_rounds_ = 1;
};

}  // namespace usct::registration
