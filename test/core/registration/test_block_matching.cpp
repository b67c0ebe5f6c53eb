#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/registration/registration_cases.h"
#include "registration/evidence/decoys.h"
#include "registration/images/image_pyramid.h"
#include "registration/search/block_matching.h"
#include "registration/search/block_search.h"
#include "registration/search/ultrasound_blocks.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::BlockMatching;
using registration::Candidate;
using registration::ImagePyramid;
using registration::RegistrationInput;
using registration::Run;
using registration::UltrasoundBlock;
using registration::UltrasoundCells;

/// The images of the preset `patient` around an initial pose, and what blocks find from there.
class Matched {
 public:
  Matched(const RegistrationCase& images, const Isometry3d& T_us_ct_initial,
          const StartOptions& region = *preset("patient").search.starts)
      : images_(images),
        initial_(T_us_ct_initial),
        ct_(images.ct),
        options_(with(region)),
        pyramid_(*registration::prepare(input(), run_)) {}

  RegistrationInput input() const { return {images_.us, ct_, initial_, options_}; }
  const ImagePyramid& images() const { return pyramid_; }
  Run& run() { return run_; }

  std::vector<Candidate> poses(const Isometry3d& mirror = Isometry3d::Identity()) {
    const BlockMatching matching(pyramid_.prepared.us, pyramid_.levels.back().images->packed_ct(),
                                 *options_.search.starts);
    return matching.poses(initial_, mirror, pyramid_.prepared.field, 4.0, 8, run_);
  }

 private:
  static RegistrationOptions with(const StartOptions& region) {
    RegistrationOptions options = preset("patient");
    options.search.starts = region;
    return options;
  }

  const RegistrationCase& images_;
  const Isometry3d initial_;
  const PreparedCt ct_;
  const RegistrationOptions options_;
  const RegistrationHooks hooks_;
  Run run_{hooks_};
  const ImagePyramid pyramid_;
};

/// Cells are up to 4 mm wide and the last rotations 3 degrees apart, and a block is not turned.
constexpr double kNearMm = 7.0;
const StartOptions kAllOrientations{StartRegion::kBall, 512, kPi, 30.0};

TEST(BlockMatching, FindsThePoseFromWhereNoClimbWould) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()})
    for (const double sign : {1.0, -1.0}) {
      const Isometry3d initial =
          beside_truth(*images, sign * Vector3d(15, -18, 20), sign * Vector3d(18, -15, 20));
      ASSERT_GT(images->error_mm(initial), 25.0);
      const std::vector<Candidate> poses = Matched(*images, initial).poses();
      ASSERT_FALSE(poses.empty());
      EXPECT_LT(images->error_mm(poses.front().T_us_ct), kNearMm) << sign;
      for (std::size_t i = 1; i < poses.size(); ++i) EXPECT_LE(poses[i].value, poses[i - 1].value);
    }
}

/// Ultrasound that lies mirrored is found where it lay, once it is mirrored again.
TEST(BlockMatching, FindsMirroredUltrasoundWhereItsMirrorImageLies) {
  const RegistrationCase& images = agar_case();
  const Isometry3d initial = beside_truth(images, {8, -6, 5}, {10, -8, 6});
  const Vector3d centre = middle_us_mm(images);
  const Vector3d normal = Vector3d(1.0, 0.3, -0.4).normalized();
  Isometry3d mirror = Isometry3d::Identity();
  mirror.linear() -= 2.0 * normal * normal.transpose();
  mirror.translation() = centre - mirror.linear() * centre;
  RegistrationCase mirrored = images;
  mirrored.us = moved(images.us, mirror);
  const std::vector<Candidate> poses = Matched(mirrored, initial).poses(mirror);
  ASSERT_FALSE(poses.empty());
  EXPECT_LT(images.error_mm(poses.front().T_us_ct), kNearMm);
}

TEST(BlockMatching, FindsThePoseInTheRegionOfTheGlobalPreset) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const Isometry3d initial = beside_truth(*images, {35, -30, 38}, {-22, 18, 25});
    const std::vector<Candidate> poses =
        Matched(*images, initial, *preset("global").search.starts).poses();
    EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), [&](const Candidate& pose) {
      return images->error_mm(pose.T_us_ct) < kNearMm;
    }));
  }
}

TEST(BlockMatching, FindsThePoseAtAnyOrientation) {
  const RegistrationCase& images = patient_case();
  for (const Vector3d& turn_deg : {Vector3d(100, -90, 80), Vector3d(0, 0, 180)}) {
    const Isometry3d initial = beside_truth(images, turn_deg, {15, -10, 12});
    const std::vector<Candidate> poses = Matched(images, initial, kAllOrientations).poses();
    ASSERT_FALSE(poses.empty());
    EXPECT_LT(images.error_mm(poses.front().T_us_ct), kNearMm) << turn_deg.transpose();
  }
}

/// At all orientations a mirror image is any other one, turned.
TEST(BlockMatching, ComparesWithOneMirrorImageAtAllOrientations) {
  const RegistrationCase& images = agar_case();
  Matched matched(images, images.T_us_ct_true, kAllOrientations);
  const auto search = registration::block_search(matched.input(), matched.images());
  ASSERT_NE(search, nullptr);
  const std::vector<registration::Decoy> decoys = registration::search_decoys(
      search->problem(), images.T_us_ct_true, images.us.beams, 1, matched.run());
  ASSERT_EQ(decoys.size(), 1U);
  EXPECT_EQ(decoys.front().mirror, Mirror::kLines);
  EXPECT_TRUE(registration::search_mirrored_ct(search->problem(), images.T_us_ct_true,
                                               images.ct.grid.direction, 1, matched.run())
                  .empty());
}

TEST(BlockMatching, CoversTheRegionsOfThePresetsAndAllOrientations) {
  EXPECT_TRUE(BlockMatching::covers(*preset("patient").search.starts));
  EXPECT_TRUE(BlockMatching::covers(*preset("global").search.starts));
  EXPECT_TRUE(BlockMatching::covers(kAllOrientations));
  EXPECT_FALSE(BlockMatching::covers({StartRegion::kBox, 512, 1.7, 25.0}));
  EXPECT_FALSE(BlockMatching::covers({StartRegion::kBox, 512, 0.4, 100.0}));
}

/// Frames that drift away step by step, each of which is small enough to be believed.
TEST(BlockMatching, LeavesOutAFieldThatTakesTooManyCells) {
  const RegistrationCase& images = patient_case();
  Matched matched(images, images.T_us_ct_true);
  ImagePyramid pyramid = matched.images();
  EXPECT_TRUE(BlockMatching::covers(*pyramid.prepared.us));
  EXPECT_NE(registration::block_search(matched.input(), pyramid), nullptr);
  for (const double step_mm : {100.0, 1e5}) {
    auto drifting = std::make_shared<BeamUltrasound>(*pyramid.prepared.us);
    BeamGrid& beams = drifting->beams;
    for (int frame = 0; frame < beams.frames; ++frame)
      for (int line = 0; line < beams.lines; ++line)
        beams.beams[static_cast<std::size_t>(frame * beams.lines + line)].origin_mm.x() +=
            step_mm * frame;
    EXPECT_FALSE(BlockMatching::covers(*drifting));
    pyramid.prepared.us = drifting;
    EXPECT_EQ(registration::block_search(matched.input(), pyramid), nullptr);
  }
}

/// Beams along z, 1 mm apart, with a brightness of 7 where `varies` is false.
BeamUltrasound cube(int edge, bool varies) {
  BeamUltrasound us;
  us.beams.lines = us.beams.frames = us.beams.axial.samples = edge;
  us.beams.axial.spacing_mm = 1.0;
  for (int f = 0; f < edge; ++f)
    for (int l = 0; l < edge; ++l) {
      us.beams.beams.push_back({Vector3d(l, f, 0.0), Vector3d::UnitZ()});
      for (int s = 0; s < edge; ++s)
        us.brightness.push_back(varies ? static_cast<float>((s / 4 + 3 * l / 4 + f) % 11) : 7.0F);
    }
  us.known.assign(us.brightness.size(), 1);
  return us;
}

/// Beams that are parallel have patches side by side, so that neighbours are as far apart as they
/// are wide.
TEST(BlockMatching, ItsPosesClimbByPatchesOfTwelveMillimetres) {
  RegistrationCase images = agar_case();
  images.us = cube(72, true);
  const Isometry3d initial =
      Eigen::Translation3d(Vector3d::Constant(36.0) - middle_us_mm(images)) * images.T_us_ct_true;
  Matched matched(images, initial);
  const auto search = registration::block_search(matched.input(), matched.images());
  ASSERT_NE(search, nullptr);
  ASSERT_EQ(search->problem().similarities.size(), 1U);
  const std::vector<Vector3d> middles_mm =
      search->problem().similarities.front().all->part_centres_us_mm();
  ASSERT_GE(middles_mm.size(), 2U);
  std::vector<double> nearest_mm;
  for (const Vector3d& one : middles_mm) {
    double least_mm = std::numeric_limits<double>::infinity();
    for (const Vector3d& other : middles_mm)
      if (&one != &other) least_mm = std::min(least_mm, (one - other).norm());
    nearest_mm.push_back(least_mm);
  }
  const auto median = nearest_mm.begin() + static_cast<std::ptrdiff_t>(nearest_mm.size() / 2);
  std::nth_element(nearest_mm.begin(), median, nearest_mm.end());
  EXPECT_NEAR(*median, 12.0, 0.5);
}

TEST(UltrasoundBlocks, AreNormalisedCubesSideBySide) {
  const UltrasoundCells cells(cube(32, true), Isometry3d::Identity(), 4.0);
  EXPECT_EQ(cells.size(), Eigen::Vector3i::Constant(8));
  const std::vector<UltrasoundBlock> blocks = cells.blocks();
  ASSERT_EQ(blocks.size(), 8U);
  for (const UltrasoundBlock& block : blocks) {
    double sum = 0.0;
    double squares = 0.0;
    for (const std::int8_t cell : block.ultrasound.cells) {
      sum += cell;
      squares += cell * cell;
    }
    EXPECT_EQ(sum, 0.0);
    EXPECT_FLOAT_EQ(block.ultrasound.norm, static_cast<float>(std::sqrt(squares)));
    EXPECT_EQ(block.ultrasound.known, 64.0F);
    const Vector3d middle = 4.0 * (block.first.cast<double>() + Vector3d::Constant(2.0));
    EXPECT_LT((block.middle_us_mm - middle).norm(), 1e-6);
  }
}

TEST(UltrasoundBlocks, NeedHalfOfTheirCellsAndVariance) {
  EXPECT_TRUE(UltrasoundCells(cube(32, false), Isometry3d::Identity(), 4.0).blocks().empty());
  BeamUltrasound us = cube(16, true);
  const auto known_below = [&](int samples) {
    for (std::size_t i = 0; i < us.known.size(); ++i)
      us.known[i] = static_cast<int>(i % 16) < samples ? 1 : 0;
    return UltrasoundCells(us, Isometry3d::Identity(), 4.0).blocks().size();
  };
  EXPECT_EQ(known_below(8), 1U);
  EXPECT_EQ(known_below(4), 0U);
  EXPECT_EQ(known_below(0), 0U);
}

/// Samples on the faces of the lattice, and those that a mirror image moves below 0, have a cell.
TEST(UltrasoundBlocks, HaveAllSamples) {
  const BeamUltrasound us = cube(33, true);
  Isometry3d mirror = Isometry3d::Identity();
  mirror.linear() = Vector3d(-1.0, 1.0, -1.0).asDiagonal();
  for (const Isometry3d& T : {Isometry3d(Isometry3d::Identity()), mirror}) {
    const UltrasoundCells cells(us, T, 0.5);
    EXPECT_EQ(cells.size(), Eigen::Vector3i::Constant(65));
    EXPECT_EQ(cells.known(), us.known.size());
  }
}

TEST(UltrasoundBlocks, LieWhereTheirSamplesDo) {
  BeamUltrasound us = cube(16, true);
  us.beams.axial.start_depth_mm = 20.0;
  const std::vector<UltrasoundBlock> blocks =
      UltrasoundCells(us, Isometry3d::Identity(), 4.0).blocks();
  ASSERT_EQ(blocks.size(), 1U);
  EXPECT_LT((blocks.front().middle_us_mm - Vector3d(8.0, 8.0, 28.0)).norm(), 1e-6);
}

/// Every third line of every third frame.
BeamUltrasound every_third(const BeamUltrasound& us) {
  BeamUltrasound few = us;
  few.beams.lines = few.beams.frames = 0;
  few.beams.beams.clear();
  few.brightness.clear();
  few.known.clear();
  const auto add = [&](auto& to, const auto& from, int beam) {
    if (!from.empty())
      to.insert(to.end(), from.begin() + beam * us.beams.samples(),
                from.begin() + (beam + 1) * us.beams.samples());
  };
  for (int f = 0; f < us.beams.frames; f += 3, ++few.beams.frames)
    for (int l = 0; l < us.beams.lines; l += 3) {
      const int beam = f * us.beams.lines + l;
      few.beams.beams.push_back(us.beams.beams[static_cast<std::size_t>(beam)]);
      add(few.brightness, us.brightness, beam);
      add(few.known, us.known, beam);
    }
  few.beams.lines = static_cast<int>(few.beams.beams.size()) / few.beams.frames;
  return few;
}

/// Beams so far apart leave most cells of 2.5 mm empty.
TEST(BlockMatching, FindsThePoseByFewBeams) {
  const RegistrationCase& images = agar_case();
  RegistrationCase few = images;
  few.us = every_third(images.us);
  const std::vector<Candidate> poses =
      Matched(few, beside_truth(images, {12, -8, 10}, {12, -10, 9})).poses();
  ASSERT_FALSE(poses.empty());
  EXPECT_LT(images.error_mm(poses.front().T_us_ct), kNearMm);
}

/// A search with one start, far from the truth, finds nothing by itself.
TEST(BlockMatching, TheRegistrationGoesOnWithItsPose) {
  const RegistrationCase& images = patient_case();
  const Isometry3d initial = beside_truth(images, {15, -18, 20}, {18, -15, 20});
  RegistrationOptions options = preset("patient");
  options.search.starts->count = 1;
  options.search.rounds = 1;
  const RegistrationResult alone = registered(images, initial, options);
  ASSERT_NE(alone.status, RegistrationStatus::kRegistered);
  options.search.rounds = 2;
  const RegistrationResult result = registered(images, initial, options);
  ASSERT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
  EXPECT_LT(images.error_mm(*result.T_us_ct), 1.0);
}

}  // namespace
}  // namespace usct::test
