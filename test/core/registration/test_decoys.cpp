#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/registration/analytic_similarity.h"
#include "core/registration/symmetric_sweeps.h"
#include "core/similarity/patch_scenes.h"
#include "registration/evidence/decoys.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Decoy;
using registration::mirror_of;
using registration::MirroredSimilarity;

constexpr Mirror kMirrors[] = {Mirror::kLines, Mirror::kFrames, Mirror::kHalfTurn};

/// The line and the frame from which a mirrored one takes its place.
std::pair<int, int> reversed(Mirror mirror, const BeamGrid& beams, int frame, int line) {
  return {mirror == Mirror::kLines ? frame : beams.frames - 1 - frame,
          mirror == Mirror::kFrames ? line : beams.lines - 1 - line};
}

RC_GTEST_PROP(MirrorOf, IsAnInvolutionThatKeepsTheCentre, ()) {
  const BeamGrid beams = beam_grid(random_motorised());
  const Vector3d centre = random_pose().translation();
  for (const Mirror mirror : kMirrors) {
    const Isometry3d motion = mirror_of(mirror, beams, centre);
    RC_ASSERT((motion * motion).isApprox(Isometry3d::Identity(), 1e-9));
    RC_ASSERT((motion * centre - centre).norm() < 1e-9);
    RC_ASSERT((motion.linear() * motion.linear().transpose()).isIdentity(1e-12));
    const double determinant = mirror == Mirror::kHalfTurn ? 1.0 : -1.0;
    RC_ASSERT(std::abs(motion.linear().determinant() - determinant) < 1e-12);
  }
}

constexpr Mirror kOfCt[] = {Mirror::kCtAxis1,  Mirror::kCtAxis2,  Mirror::kCtAxis3,
                            Mirror::kCtAxes12, Mirror::kCtAxes13, Mirror::kCtAxes23};

/// Where the ultrasound at a pose lies in a mirrored CT: relative to the centre of the field, one
/// coordinate in the CT's grid changes its sign, or two change places.
RC_GTEST_PROP(CtMirrorOf, ReversesOrExchangesCoordinatesInTheGrid, ()) {
  const Eigen::Matrix3d axes = random_pose().linear();
  const Isometry3d T_us_ct = random_pose();
  const Vector3d centre = random_pose().translation();
  const Isometry3d T_ct_us = T_us_ct.inverse();
  const std::pair<int, int> pairs[] = {{0, 1}, {0, 2}, {1, 2}};
  for (int i = 0; i < 6; ++i) {
    const Isometry3d motion = registration::ct_mirror_of(kOfCt[i], axes, T_us_ct, centre);
    const Vector3d p = random_pose().translation();
    Vector3d along = axes.transpose() * (T_ct_us * p - T_ct_us * centre);
    if (i < 3)
      along[i] *= -1.0;
    else
      std::swap(along[pairs[i - 3].first], along[pairs[i - 3].second]);
    RC_ASSERT((T_ct_us * (motion * p) - (T_ct_us * centre + axes * along)).norm() < 1e-7);
  }
}

/// The beams, and the middle of their field, in another US frame.
struct Sweep {
  BeamGrid beams;
  Vector3d centre;

  Sweep(BeamGrid grid, const Isometry3d& motion)
      : beams(std::move(grid)), centre(motion * middle_of_samples(beams)) {
    for (Beam& beam : beams.beams)
      beam = {motion * beam.origin_mm, motion.linear() * beam.direction};
  }
};

RC_GTEST_PROP(MirrorOf, PutsEverySampleWhereReversedOrderPutsIt, ()) {
  const int samples = integer(2, 40), lines = integer(2, 20), frames = integer(2, 20);
  const Isometry3d motion = random_pose();
  for (const Sweep& sweep :
       {Sweep(symmetric_motorised(samples, lines, frames, uniform(0.01, 0.07), uniform(0.01, 0.07)),
              motion),
        Sweep(straight_tracked(samples, lines, frames, uniform(0.2, 3.0)), motion)})
    for (const Mirror mirror : kMirrors) {
      const Isometry3d T = mirror_of(mirror, sweep.beams, sweep.centre);
      for (int f = 0; f < frames; ++f)
        for (int l = 0; l < lines; ++l) {
          const auto [frame, line] = reversed(mirror, sweep.beams, f, l);
          for (const int s : {0, samples - 1})
            RC_ASSERT((T * sweep.beams.point(f, l, s) - sweep.beams.point(frame, line, s)).norm() <
                      1e-8);
        }
    }
}

/// Ultrasound with its lines, its frames or both in reverse order.
BeamUltrasound reversed(Mirror mirror, const BeamUltrasound& us) {
  BeamUltrasound result = us;
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < us.beams.lines; ++l)
      for (int s = 0; s < us.beams.samples(); ++s) {
        const auto [frame, line] = reversed(mirror, us.beams, f, l);
        result.brightness[offset_of(us.beams, s, l, f)] =
            us.brightness[offset_of(us.beams, s, line, frame)];
      }
  return result;
}

/// The patches are their own mirror image as well: both sizes are multiples of their edge.
TEST(MirroredSimilarity, IsThatOfTheUltrasoundInReverseOrder) {
  const BeamUltrasound us = noisy_ultrasound(downward_beams(18, 24, 12));
  const Volume<float> ct = wavy_ct(oblique_grid({40, 44, 48}, {1.1, 1.0, 0.9}));
  const Isometry3d T_ct_us(Eigen::Translation3d(2.0, -1.5, 3.0) *
                           Eigen::AngleAxisd(0.3, Vector3d(1, 1, -2).normalized()));
  for (SimilarityOptions options : all_metrics()) {
    patches_of(options) = cubes(6.0);
    const auto original = similarity_of(us, ct, options);
    for (const Mirror mirror : kMirrors) {
      SCOPED_TRACE(std::string(similarity_name(options)) + ", mirror " +
                   std::to_string(static_cast<int>(mirror)));
      const MirroredSimilarity mirrored(*original, mirror_of(mirror, us.beams, Vector3d::Zero()));
      const SimilarityValue expected =
          value_at(*similarity_of(reversed(mirror, us), ct, options), T_ct_us);
      const SimilarityValue found = value_at(mirrored, T_ct_us);
      EXPECT_NEAR(found.value, expected.value, 1e-5 * std::abs(expected.value) + 1e-8);
      EXPECT_NEAR(found.overlap, expected.overlap, 1e-3);
      // The original itself has another value, and the parts belong to the same pose.
      EXPECT_GT(std::abs(found.value - value_at(*original, T_ct_us).value),
                5e-5 * std::abs(expected.value));
      double sum = 0.0;
      for (const double part : mirrored.parts({T_ct_us, {}})) sum += part;
      EXPECT_NEAR(sum, found.value, 1e-9);
    }
  }
}

/// A search from the identity in the field of `cube_field`, on the same peaks at both levels.
class Searched {
 public:
  explicit Searched(std::vector<Peak> peaks) : peaks_(field_, std::move(peaks)) {
    options_.starts->count = 64;
    options_.levels.resize(2);
    for (LevelOptions& level : options_.levels) {
      level.optimizer.method = OptimizerMethod::kBobyqa;
      level.optimizer.max_evaluations = 300;
      level.optimizer.initial_step = 3.0;
      level.optimizer.step_tolerance = 0.05;
      level.optimised = 8;
      level.kept = 4;
    }
  }
  /// The decoys of a symmetric sweep around the middle of the field.
  std::vector<Decoy> decoys(const Similarity& similarity, const Isometry3d& T_us_ct_found,
                            int rounds = 1) {
    return decoys(similarity, T_us_ct_found, beams(), rounds);
  }
  std::vector<Decoy> decoys(const BeamGrid& beams) {
    return decoys(peaks_, Isometry3d::Identity(), beams, 1);
  }
  std::vector<Decoy> decoys(const Isometry3d& T_us_ct_found, int rounds = 1) {
    return decoys(peaks_, T_us_ct_found, rounds);
  }
  std::vector<Decoy> further(std::vector<Decoy> decoys, const Isometry3d& T_us_ct_found,
                             int rounds) {
    return registration::searched_further(
        std::move(decoys),
        {{{&peaks_, nullptr}, {&peaks_, nullptr}}, options_, initial_, field_, 1}, T_us_ct_found,
        rounds, run_);
  }
  std::vector<Decoy> of_mirrored_ct(const Isometry3d& T_us_ct_found, const Eigen::Matrix3d& axes) {
    return registration::search_mirrored_ct(
        {{{&peaks_, nullptr}, {&peaks_, nullptr}}, options_, initial_, field_, 1}, T_us_ct_found,
        axes, 1, run_);
  }
  double distance_mm(const Isometry3d& T_a, const Isometry3d& T_b) const {
    return field_.distance_mm(T_a, T_b);
  }
  static BeamGrid beams() { return symmetric_motorised(40, 9, 9, 0.05, 0.05); }

 private:
  std::vector<Decoy> decoys(const Similarity& similarity, const Isometry3d& T_us_ct_found,
                            const BeamGrid& beams, int rounds) {
    return registration::search_decoys(
        {{{&similarity, nullptr}, {&similarity, nullptr}}, options_, initial_, field_, 1},
        T_us_ct_found, beams, rounds, run_);
  }

  registration::FieldPoints field_ = cube_field();
  PeaksSimilarity peaks_;
  SearchOptions options_;
  Isometry3d initial_ = Isometry3d::Identity();
  RegistrationHooks hooks_;
  registration::Run run_{hooks_};
};

/// A peak where the mirrored ultrasound fits is found by that decoy, and by no other.
TEST(SearchDecoys, EachFindsThePoseOfItsOwnMirror) {
  const Isometry3d right(Eigen::Translation3d(6.0, -5.0, 4.0));
  const Isometry3d elsewhere(Eigen::Translation3d(-7.0, 3.0, 5.0));
  for (const Mirror mirror : kMirrors) {
    const Isometry3d motion = mirror_of(mirror, Searched::beams(), cube_field().centre_us_mm());
    // The ultrasound fits at `right`, and its mirror image at `elsewhere`.
    Searched searched({{right, 1.0, 6.0}, {motion * elsewhere, 0.7, 6.0}});
    const std::vector<Decoy> decoys = searched.decoys(right);
    ASSERT_EQ(decoys.size(), 3U);
    for (const Decoy& decoy : decoys) {
      EXPECT_TRUE(decoy.T_mirror.isApprox(
          mirror_of(decoy.mirror, Searched::beams(), cube_field().centre_us_mm())));
      if (decoy.mirror == mirror) {
        EXPECT_NEAR(decoy.best.value, 0.7, 0.02);
        EXPECT_LT(searched.distance_mm(decoy.best.T_us_ct, elsewhere), 1.0);
      } else {
        EXPECT_LT(decoy.best.value, 0.5);
      }
    }
  }
}

TEST(SearchMirroredCt, EachFindsThePoseOfItsOwnMirror) {
  const Isometry3d right(Eigen::Translation3d(6.0, -5.0, 4.0));
  const Isometry3d elsewhere(Eigen::Translation3d(-7.0, 3.0, 5.0));
  const Eigen::Matrix3d axes =
      Eigen::AngleAxisd(0.8, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (const Mirror mirror : kOfCt) {
    const Isometry3d motion = registration::ct_mirror_of(mirror, axes, Isometry3d::Identity(),
                                                         cube_field().centre_us_mm());
    Searched searched({{right, 1.0, 6.0}, {motion * elsewhere, 0.7, 6.0}});
    const std::vector<Decoy> decoys = searched.of_mirrored_ct(right, axes);
    ASSERT_EQ(decoys.size(), 6U);
    for (const Decoy& decoy : decoys) {
      if (decoy.mirror != mirror) continue;
      EXPECT_NEAR(decoy.best.value, 0.7, 0.02);
      EXPECT_LT(searched.distance_mm(decoy.best.T_us_ct, elsewhere), 1.0);
    }
  }
}

/// The CT is mirrored in a plane through the middle of the field. If the anatomy lies beside it, so
/// does the pose, twice as far, beyond what is searched for ultrasound.
TEST(SearchMirroredCt, LooksBesideTheMiddleOfTheField) {
  const Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  for (const double sign : {1.0, -1.0}) {
    const Isometry3d beside(Eigen::Translation3d(sign * 40.0, 2.0, -3.0));
    const Isometry3d motion = registration::ct_mirror_of(
        Mirror::kCtAxis1, axes, Isometry3d::Identity(), cube_field().centre_us_mm());
    Searched searched({{motion * beside, 1.0, 3.0}});
    const std::vector<Decoy> mirrored_ct = searched.of_mirrored_ct(Isometry3d::Identity(), axes);
    ASSERT_EQ(mirrored_ct.front().mirror, Mirror::kCtAxis1);
    EXPECT_LT(searched.distance_mm(mirrored_ct.front().best.T_us_ct, beside), 1.0);
  }
}

/// Where the lines on one side have no contact, what counts lies beside the middle of the recorded
/// field. If lines and frames were recorded in reverse order, the ultrasound lies twice as far on
/// the other side of it, beyond what is searched otherwise.
TEST(SearchDecoys, LookWhereUltrasoundInReverseOrderWouldLie) {
  const Isometry3d right(Eigen::Translation3d(6.0, -5.0, 4.0));
  const Vector3d beside(60.0, 0.0, 60.0);  // so far that no climb reaches it from other starts
  BeamGrid beams = Searched::beams();
  for (Beam& beam : beams.beams) beam.origin_mm += beside;
  const Vector3d middle = cube_field().centre_us_mm() + beside;
  for (const Mirror mirror : kMirrors) {
    // The ultrasound as it would have been recorded in the other order fits at `right`.
    Searched searched({{mirror_of(mirror, beams, middle) * right, 1.0, 3.0}});
    const std::vector<Decoy> decoys = searched.decoys(beams);
    ASSERT_EQ(decoys.size(), 3U);
    EXPECT_TRUE(registration::lacks_a_side(decoys));
    EXPECT_FALSE(registration::lacks_a_side(searched.decoys(Searched::beams())));
    for (const Decoy& decoy : decoys) {
      if (decoy.mirror != mirror) continue;
      EXPECT_NEAR(decoy.best.value, 1.0, 0.02);
      EXPECT_LT(searched.distance_mm(decoy.T_mirror * decoy.best.T_us_ct,
                                     mirror_of(mirror, beams, middle) * right),
                1.0);
    }
  }
}

TEST(SearchDecoys, ThoseWithoutAnyValueAreLeftOut) {
  EXPECT_TRUE(Searched({}).decoys(NoSimilarity(), Isometry3d::Identity()).empty());
}

/// A nearly symmetric anatomy explains mirrored ultrasound near the pose that was found. The peak
/// there is so narrow that no start lies on its slope; a wide peak elsewhere attracts them all.
TEST(SearchDecoys, TheyClimbFromThePoseThatWasFound) {
  const Isometry3d found(Eigen::Translation3d(11.0, -9.0, 13.0));
  const Isometry3d beside = Eigen::Translation3d(1.0, 0.5, 0.0) * found;
  const Isometry3d elsewhere(Eigen::Translation3d(-12.0, 8.0, -10.0));
  const Isometry3d motion =
      mirror_of(Mirror::kLines, Searched::beams(), cube_field().centre_us_mm());
  Searched searched({{motion * beside, 1.0, 1.0}, {motion * elsewhere, 0.5, 25.0}});
  const auto height = [&](const Isometry3d& T_us_ct_found) {
    const std::vector<Decoy> decoys = searched.decoys(T_us_ct_found);
    EXPECT_EQ(decoys.front().mirror, Mirror::kLines);
    return decoys.front().best.value;
  };
  EXPECT_GT(height(found), 0.95);
  EXPECT_LT(height(Isometry3d::Identity()), 0.6);
  // A search that goes on climbs from the pose that was found since, and searches no round again.
  const std::vector<Decoy> before = searched.decoys(Isometry3d::Identity());
  const std::vector<Decoy> after = searched.further(before, found, 1);
  EXPECT_GT(after.front().best.value, 0.95);
  EXPECT_EQ(after.front().optima.size(), before.front().optima.size() + 1);
}

/// A pose that a later round found had more starts, and is compared with decoys that had as many.
TEST(SearchDecoys, MoreRoundsFindNarrowerPeaks) {
  const Isometry3d narrow(Eigen::Translation3d(8.0, -8.0, 8.0));
  const Isometry3d wide(Eigen::Translation3d(-12.0, 8.0, -10.0));
  const Isometry3d motion =
      mirror_of(Mirror::kLines, Searched::beams(), cube_field().centre_us_mm());
  Searched searched({{motion * narrow, 1.0, 4.0}, {motion * wide, 0.5, 8.0}});
  const auto height = [&](int rounds) {
    return searched.decoys(Isometry3d::Identity(), rounds).front().best.value;
  };
  EXPECT_LT(height(1), 0.6);
  EXPECT_GT(height(3), 0.95);
  const std::vector<Decoy> gone_on =
      searched.further(searched.decoys(Isometry3d::Identity(), 1), Isometry3d::Identity(), 3);
  EXPECT_EQ(gone_on.front().best.value, height(3));
  EXPECT_EQ(gone_on.front().rounds, 3);
}

}  // namespace
}  // namespace usct::test
