#pragma once

#include <optional>
#include <vector>

#include "registration/decoys.h"
#include "registration/image_pyramid.h"
#include "registration/outcome.h"
#include "registration/parts.h"

/// The evidence for a pose, from the case itself: mirrored ultrasound, rivals, parts of the field.
namespace usct::registration {

struct Assessment {
  Measures measures;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  /// The best mirrored ultrasound, or mirrored CT that fits better than the pose; unset if none has
  /// a value.
  std::optional<Mirror> best_mirror;
};

/// Whether another round could find the right pose: the one that was found is no better than
/// chance, or no firmer than a wrong one. Not if mirrored ultrasound fits so much better that it is
/// the right one.
bool may_be_missed(const Assessment& assessment);

/// Images, and the search on them that the evidence is compared with. Both must outlive it.
struct EvidenceImages {
  const ImagePyramid& images;
  const SearchProblem& problem;
};

class PatchComparison;

class Assessor {
 public:
  /// `problem` is the search on `images`. The objects that the arguments refer to must outlive the
  /// assessor.
  Assessor(const BeamUltrasound& ultrasound, const CtVolume& ct, const ImagePyramid& images,
           const SearchProblem& problem, const RegistrationOptions& options)
      : ultrasound_(ultrasound), ct_(ct), images_(images), problem_(problem), options_(options) {}

  /// Whether a gate asks for evidence, and it comes from these images.
  bool gathers(EvidenceSource source) const;
  /// Decoys that `compare` found, and decoys that it shall compare with in place of a search.
  const std::optional<std::vector<Decoy>>& decoys() const { return decoys_; }
  /// A pose in this CT was accepted then, so that its axes are known to be right.
  void take_over(std::vector<Decoy> decoys) {
    decoys_ = std::move(decoys);
    ct_is_known_ = true;
  }
  /// Lets the next comparison search for the decoys in so many rounds: a pose that a later round
  /// found had more starts, and so must the decoys that it is compared with.
  void search_decoys_again(int rounds) {
    decoys_.reset();
    decoy_rounds_ = rounds;
  }
  /// Compares the best of the optima of the search, best first, with mirrored ultrasound and with
  /// its rivals. Evidence is gathered only if a gate asks for it; that of other images is left to
  /// `assess`.
  Assessment compare(const std::vector<Candidate>& optima, Run& run);
  /// Whether a pose that was compared is worth its refinement. It is not if it would be refused
  /// even if all parts of the field agreed about it, and another round could find a better one.
  bool parts_could_save(const Assessment& compared) const;
  /// Completes what `compare` made of these optima; `refined` is the first one after its
  /// refinement. Refuses if the images of the evidence cannot be made.
  Outcome<Assessment> assess(Assessment compared, const std::vector<Candidate>& optima,
                             const Candidate& refined, Run& run);

 private:
  void compare_with_others(const EvidenceImages& on, const std::vector<Candidate>& optima,
                           Assessment& assessment, Run& run);
  std::optional<Refusal> compare_as_patient(const Candidate& refined, Assessment& assessment,
                                            Run& run);
  void compare_with_decoys(const EvidenceImages& on, const Candidate& best,
                           const PatchComparison& patches, Assessment& result, Run& run);
  /// The probability that the pose is wrong, by all evidence. A pose that it would accept, but not
  /// beyond doubt, is also compared with mirrored CTs.
  void conclude(const EvidenceImages& on, const Candidate& best, Assessment& assessment,
                Run& run) const;
  /// A mirrored CT that fits better, as a whole and patch by patch, is the best mirror.
  void compare_with_mirrored_ct(const EvidenceImages& on, const Candidate& best,
                                Assessment& assessment, Run& run) const;
  void compare_with_rivals(const EvidenceImages& on, const std::vector<Candidate>& optima,
                           const PatchComparison& patches, Measures& measures) const;
  /// Measures from the field of view alone at the refined pose: agreement of its parts, and errors
  /// of the acquisition unless the refinement estimated them.
  void check_field(const EvidenceImages& on, const Candidate& refined, Assessment& assessment,
                   Run& run) const;
  void compare_clusters(const EvidenceImages& on, const Candidate& refined, Measures& measures,
                        Run& run) const;
  void compare_parts(const EvidenceImages& on, const Candidate& refined, Assessment& result,
                     Run& run) const;

  const BeamUltrasound& ultrasound_;
  const CtVolume& ct_;
  const ImagePyramid& images_;
  const SearchProblem& problem_;
  const RegistrationOptions& options_;
  /// They are kept from round to round: what is no better than decoys of fewer starts is refused.
  std::optional<std::vector<Decoy>> decoys_;
  int decoy_rounds_ = 1;
  bool ct_is_known_ = false;
};

}  // namespace usct::registration
