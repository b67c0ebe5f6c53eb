#pragma once

#include <optional>
#include <vector>

#include "registration/evidence/decoys.h"
#include "registration/evidence/parts.h"
#include "registration/images/image_pyramid.h"

/// The evidence for a pose, from the case itself: mirrored ultrasound, rivals, parts of the field.
namespace usct::registration {

struct Assessment {
  Measures measures;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  /// The best mirrored ultrasound, or mirrored CT that fits better than the pose; unset if none has
  /// a value.
  std::optional<Mirror> best_mirror;
  /// The motion, US frame, by which blocks of the field would rather lie together; see
  /// LocalAgreement.
  std::optional<Eigen::Isometry3d> wished_motion;
};

class PatchComparison;

/// The images, the search and the options that the evidence is gathered with. All must outlive it.
struct EvidenceInput {
  /// As it was recorded.
  const BeamUltrasound& ultrasound;
  const CtVolume& ct;
  const ImagePyramid& images;
  /// The search on `images`.
  const SearchProblem& problem;
  const ConfidenceOptions& options;
};

/// Gathers the evidence on one set of images.
class Evidence {
 public:
  explicit Evidence(const EvidenceInput& input) : in_(input) {}

  /// Decoys that were found, and decoys to compare with in place of a search.
  const std::optional<std::vector<Decoy>>& decoys() const { return decoys_; }
  /// A pose in this CT was accepted then, so that its axes are known to be right.
  void take_over(std::vector<Decoy> decoys) {
    decoys_ = std::move(decoys);
    ct_is_known_ = true;
  }
  /// Whether what blocks of the field gain by a pose is sure enough for it to be believed.
  bool blocks_agree(const Candidate& pose, Run& run) const;
  /// Compares the best of the optima of the search, best first, with mirrored ultrasound and with
  /// its rivals. The decoys of the first pose are compared with all.
  void compare(const std::vector<Candidate>& optima, Assessment& assessment, Run& run);
  /// The same with decoys that are searched for in so many rounds, and near the pose: one that a
  /// later round found had more starts, and so must the decoys that it is compared with.
  void compare_further(const std::vector<Candidate>& optima, int rounds, Assessment& assessment,
                       Run& run);
  /// Completes what `compare` made of the optima by measures from the field of view alone at the
  /// pose after its refinement, and takes the probability that the pose is wrong.
  void check(const Candidate& refined, Assessment& assessment, Run& run);
  /// Gathers the evidence that takes long, where it could decide about a checked pose: the
  /// agreement of mirror images, and mirrored CTs.
  void settle(const Candidate& best, Assessment& assessment, Run& run);

 private:
  SimilarityImages& deciding_images() const { return *in_.images.levels.back().images; }
  const FieldPoints& field() const { return in_.images.prepared.field; }

  void compare_with_decoys(const Candidate& best, const PatchComparison& patches,
                           Assessment& result) const;
  void compare_with_rivals(const std::vector<Candidate>& optima, const PatchComparison& patches,
                           Measures& measures) const;
  void compare_clusters(const Candidate& pose, Assessment& assessment, Run& run);
  std::vector<HalfPoses> compare_parts(const Candidate& refined, Measures& measures,
                                       Run& run) const;
  /// The covariance of the pose and what follows from it.
  void expect_error(const std::vector<HalfPoses>& halves, Assessment& result) const;
  /// Estimates errors of the acquisition. Returns the pose with the wrong sweep that the images
  /// show, or `refined` if they show none, or wrong depths.
  Candidate estimate_errors(const Candidate& refined, Measures& measures, Run& run) const;
  /// The deciding images; with beams if they are looked at with a wrong sweep that they show.
  SimilarityImages& images_for(const Measures& measures);
  void compare_agreement(Measures& measures, Run& run);
  /// A mirrored CT that fits better as a whole is compared with as mirrored ultrasound is. Of those
  /// that leave the pose less probable the most similar one is the best mirror.
  void compare_with_mirrored_ct(const Candidate& best, Assessment& assessment, Run& run);

  const EvidenceInput in_;
  /// They are kept from round to round: what is no better than decoys of fewer starts is refused.
  std::optional<std::vector<Decoy>> decoys_;
  std::optional<std::vector<Decoy>> mirrored_ct_;
  std::optional<SimilarityImages> along_beams_;
  int decoy_rounds_ = 1;
  bool ct_is_known_ = false;
};

}  // namespace usct::registration
