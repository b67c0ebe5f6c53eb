#pragma once

#include <vector>

#include "registration/evidence/field_axes.h"
#include "registration/search/multi_start.h"
#include "us_ct_registration/registration/measures.h"

/// Decoys: the ultrasound mirrored, and searched for in the CT like the ultrasound itself. A
/// mirrored field of view has the same brightness, noise and layers, but no right pose. The
/// similarity that decoys reach is therefore what chance, and an anatomy that is nearly symmetric,
/// can reach in this very case. A CT with reversed or exchanged axes is a mirror image too, but
/// turned by an angle that the search does not reach; ultrasound that is mirrored in the same way
/// does.
namespace usct::registration {

/// The motion of the field of view that mirrors the ultrasound, US frame, mm. It keeps the centre
/// of the field. Reversed lines and reversed frames are reflections (determinant -1), both together
/// are a half turn about the beams.
Eigen::Isometry3d mirror_of(Mirror mirror, const BeamGrid& beams,
                            const Eigen::Vector3d& centre_us_mm);

/// The same for a mirrored CT, the axes of whose grid in the CT frame are the columns of `axes`: a
/// reflection that brings ultrasound at T_us_ct to where it would be in the other CT.
Eigen::Isometry3d ct_mirror_of(Mirror mirror, const Eigen::Matrix3d& axes,
                               const Eigen::Isometry3d& T_us_ct,
                               const Eigen::Vector3d& centre_us_mm);

/// The similarity of the mirrored ultrasound: that of the ultrasound at T_ct_us * mirror. The
/// original must outlive it. Must not be used with a similarity that simulates beams, which accepts
/// rotations alone.
class MirroredSimilarity final : public Similarity {
 public:
  MirroredSimilarity(const Similarity& original, const Eigen::Isometry3d& mirror)
      : original_(original), mirror_(mirror) {}

  using Similarity::evaluate;
  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check& check) const override;
  using Similarity::derivatives;
  std::optional<SimilarityDerivatives> derivatives(const SimilarityPose& pose,
                                                   DerivativeOrder order,
                                                   double above) const override;
  bool has_error_derivatives() const override { return original_.has_error_derivatives(); }
  std::vector<double> parts(const SimilarityPose& pose) const override {
    return original_.parts(mirrored(pose));
  }
  /// Parts lie where they lie in the ultrasound as it was recorded.
  std::vector<Eigen::Vector3d> part_centres_us_mm() const override {
    return original_.part_centres_us_mm();
  }

 private:
  SimilarityPose mirrored(const SimilarityPose& pose) const {
    return {pose.T_ct_us * mirror_, pose.errors};
  }

  const Similarity& original_;
  Eigen::Isometry3d mirror_;
};

/// One decoy, and the best pose that the search found for it.
struct Decoy {
  Mirror mirror = Mirror::kLines;
  Eigen::Isometry3d T_mirror = Eigen::Isometry3d::Identity();
  Candidate best;
  /// All optima of the rounds so far, best first.
  std::vector<Candidate> optima;
  int rounds = 0;
  /// The search looks for it at these translations too: SearchProblem::start_shifts_us_mm.
  std::vector<Eigen::Vector3d> start_shifts_us_mm = {};
};

/// Searches for the decoys as `problem` searches for the ultrasound, and climbs from the pose that
/// was found for it too. Where what counts lies beside the middle of the recorded field, it also
/// looks where the ultrasound would lie if its lines or frames had been recorded in reverse order.
/// Decoys without any value are left out.
std::vector<Decoy> search_decoys(const SearchProblem& problem,
                                 const Eigen::Isometry3d& T_us_ct_found, const BeamGrid& beams,
                                 int rounds, Run& run);

/// Whether much more of the field counts on one side than on the other, as the decoys of such
/// ultrasound show: they are also searched for elsewhere.
bool lacks_a_side(const std::vector<Decoy>& decoys);

/// Whether the CT is mirrored, and not the ultrasound.
bool is_of_ct(Mirror mirror);

/// Searches for ultrasound that is mirrored as a mirrored CT would be, wider than `problem` does:
/// the middle of the anatomy need not be that of the field, in which the CT is mirrored here. The
/// mirrored CTs compete, for at most one of them is right. Empty where blocks are matched at all
/// orientations, at which mirrored ultrasound is a mirrored CT.
std::vector<Decoy> search_mirrored_ct(const SearchProblem& problem,
                                      const Eigen::Isometry3d& T_us_ct_found,
                                      const Eigen::Matrix3d& axes, int rounds, Run& run);

/// Goes on with such a search where it ended, up to so many rounds in all, and climbs from a pose
/// that was found for the ultrasound since.
std::vector<Decoy> searched_further(std::vector<Decoy> decoys, const SearchProblem& problem,
                                    const Eigen::Isometry3d& T_us_ct_found, int rounds, Run& run);

}  // namespace usct::registration
