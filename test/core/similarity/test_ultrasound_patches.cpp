#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <map>
#include <set>

#include "core/registration/symmetric_sweeps.h"
#include "core/similarity/patch_scenes.h"
#include "core/ultrasound/turning_sweeps.h"
#include "ultrasound/sweep_motion.h"
#include "us_ct_registration/error.h"
#include "with_threads.h"

namespace usct::test {
namespace {

using Position = std::array<float, 3>;

Position position_of(const Eigen::Vector3d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

Position position_at(const UltrasoundPatches& us, std::size_t place) {
  return {us.x_mm[place], us.y_mm[place], us.z_mm[place]};
}

bool is_filled_up(const UltrasoundPatches& us, std::size_t place) {
  return us.x_mm[place] == UltrasoundPatches::kNowhere;
}

/// The sample, line and frame at each position.
std::map<Position, Eigen::Vector3i> places_of(const BeamGrid& beams) {
  std::map<Position, Eigen::Vector3i> places;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s)
        places[position_of(beams.point(f, l, s))] = {s, l, f};
  return places;
}

/// The places of the samples of a patch in the arrays.
std::vector<std::size_t> places_of(const UltrasoundPatches& us,
                                   const UltrasoundPatches::Patch& patch) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < patch.strands(); ++i) {
    const std::size_t strand = patch.first_strand + i;
    const UltrasoundPatches::Block& block = us.blocks[strand / UltrasoundPatches::kLanes];
    for (std::size_t row = 0; row < block.rows; ++row) {
      const std::size_t place =
          block.begin + row * UltrasoundPatches::kLanes + strand % UltrasoundPatches::kLanes;
      if (!is_filled_up(us, place)) places.push_back(place);
    }
  }
  return places;
}

RC_GTEST_PROP(UltrasoundPatches, ArePartitionsOfWhatIsKnown, ()) {
  BeamUltrasound us =
      noisy_ultrasound(downward_beams(integer(4, 40), integer(2, 20), integer(2, 14)));
  if (*rc::gen::arbitrary<bool>())
    for (std::size_t i = 0; i < us.brightness.size(); ++i) us.known.push_back(hashed(i) > 20000.0);
  const int edge = integer(1, 12);
  const auto expected = seen_by_patches(us, edge, wavy_ct(oblique_grid({4, 4, 4}, {1, 1, 1})),
                                        Eigen::Isometry3d::Identity(), GradientChannel::kMagnitude);
  const UltrasoundPatches patches = cut_into_patches(us, cubes(edge));
  RC_ASSERT(patches.patches.size() == expected.size());
  RC_ASSERT(patches.count == all_of(expected).size());

  const auto places = places_of(us.beams);
  std::set<std::array<int, 3>> boxes;
  std::size_t samples = 0;
  for (const UltrasoundPatches::Patch& patch : patches.patches) {
    const std::vector<std::size_t> in = places_of(patches, patch);
    RC_ASSERT(in.size() == patch.count);
    samples += patch.count;
    std::set<std::array<int, 3>> box;
    double sum = 0.0, squares = 0.0;
    for (const std::size_t place : in) {
      const Eigen::Vector3i at = places.at(position_at(patches, place));
      box.insert({at.x() / edge, at.y() / edge, at.z() / edge});
      const std::size_t i = offset_of(us.beams, at.x(), at.y(), at.z());
      RC_ASSERT((us.known.empty() || us.known[i] != 0));
      const double value = static_cast<double>(patches.value[place]);
      RC_ASSERT(std::abs(value + patch.mean - us.brightness[i]) < 1e-4);
      RC_ASSERT(patches.depth_mm[place] == static_cast<float>(us.beams.axial.depth_mm(at.x())));
      RC_ASSERT(patches.direction_y[place] == 1.0F);
      sum += value;
      squares += value * value;
    }
    RC_ASSERT(box.size() == 1U);
    RC_ASSERT(boxes.insert(*box.begin()).second);
    RC_ASSERT(std::abs(sum) < 1e-3);
    RC_ASSERT(std::abs(squares - patch.square_sum) < 1e-3 * (1.0 + patch.square_sum));
  }
  RC_ASSERT(samples == patches.count);
  std::size_t filled = 0;
  for (std::size_t place = 0; place < patches.value.size(); ++place)
    if (is_filled_up(patches, place)) {
      ++filled;
      RC_ASSERT(patches.value[place] == 0.0F);
      RC_ASSERT(patches.depth_mm[place] == 0.0F);
    }
  RC_ASSERT(filled + samples == patches.value.size());
}

RC_GTEST_PROP(UltrasoundPatches, LieInLanes, ()) {
  BeamUltrasound us =
      noisy_ultrasound(downward_beams(integer(4, 60), integer(2, 20), integer(2, 14)));
  for (std::size_t i = 0; i < us.brightness.size(); ++i) us.known.push_back(hashed(i) > 15000.0);
  const UltrasoundPatches patches = cut_into_patches(us, cubes(integer(2, 12)));
  RC_PRE(!patches.patches.empty());
  std::size_t begin = 0;
  for (const UltrasoundPatches::Block& block : patches.blocks) {
    RC_ASSERT(block.begin == begin);
    RC_ASSERT((block.rows >= 1U && block.rows <= UltrasoundPatches::kLongestStrand));
    begin += block.rows * UltrasoundPatches::kLanes;
  }
  for (const auto* values :
       {&patches.x_mm, &patches.y_mm, &patches.z_mm, &patches.value, &patches.direction_x,
        &patches.direction_y, &patches.direction_z, &patches.depth_mm, &patches.sweep_x,
        &patches.sweep_y, &patches.sweep_z, &patches.sweep_side})
    RC_ASSERT(values->size() == begin);
  for (std::size_t p = 0; p < patches.patches.size(); ++p) {
    const UltrasoundPatches::Patch& patch = patches.patches[p];
    RC_ASSERT((patch.strands() == 1U) == (p >= patches.first_single_patch));
    if (p >= patches.first_single_patch)
      RC_ASSERT(patch.first_strand == patches.first_single_block * UltrasoundPatches::kLanes + p -
                                          patches.first_single_patch);
    if (p > 0) RC_ASSERT(patch.count <= patches.patches[p - 1].count);
  }
}

/// Properties of the layout that the kernels rely on without checks.
RC_GTEST_PROP(UltrasoundPatches, BlocksTellWhichRowsAreFullAndWhereTheyLie, ()) {
  BeamUltrasound us =
      noisy_ultrasound(downward_beams(integer(4, 40), integer(2, 20), integer(2, 14)));
  for (std::size_t i = 0; i < us.brightness.size(); ++i) us.known.push_back(hashed(i) > 10000.0);
  const UltrasoundPatches patches = cut_into_patches(us, cubes(integer(1, 12)));
  for (const UltrasoundPatches::Block& block : patches.blocks) {
    std::size_t full = block.rows;
    Eigen::AlignedBox3f box;
    for (std::size_t i = 0; i < block.rows * UltrasoundPatches::kLanes; ++i) {
      const auto [x, y, z] = position_at(patches, block.begin + i);
      if (is_filled_up(patches, block.begin + i))
        full = std::min(full, i / UltrasoundPatches::kLanes);
      else
        box.extend(Eigen::Vector3f(x, y, z));
    }
    RC_ASSERT(block.full_rows == full);
    RC_ASSERT(block.box.isApprox(box));
  }
}

TEST(UltrasoundPatches, WithoutMaskHardlyAnythingIsFilledUp) {
  const UltrasoundPatches patches =
      cut_into_patches(noisy_ultrasound(downward_beams(77, 64, 40)), cubes(3.0));
  EXPECT_LT(static_cast<double>(patches.value.size()), 1.02 * static_cast<double>(patches.count));
}

TEST(UltrasoundPatches, OfInfiniteSizeAreOne) {
  const UltrasoundPatches patches =
      cut_into_patches(noisy_ultrasound(downward_beams(20, 9, 5)), PatchOptions::whole());
  ASSERT_EQ(patches.patches.size(), 1U);
  EXPECT_EQ(patches.count, 900U);
  EXPECT_EQ(patches.first_single_block, patches.blocks.size());
  EXPECT_EQ(places_of(patches, patches.patches.front()).size(), 900U);
}

TEST(UltrasoundPatches, EdgesAreMillimetresInTheMiddleOfTheDepths) {
  // Samples are 0.5 mm apart along a line, lines 1 mm and frames 2 mm.
  BeamGrid beams = downward_beams(24, 12, 6);
  beams.axial.spacing_mm = 0.5;
  for (Beam& beam : beams.beams) beam.origin_mm.z() *= 2.0;
  const UltrasoundPatches patches = cut_into_patches(noisy_ultrasound(beams), cubes(4.0));
  EXPECT_EQ(patches.patches.size(), 3U * 3U * 3U);
  for (const UltrasoundPatches::Patch& patch : patches.patches)
    EXPECT_EQ(patch.count, 8U * 4U * 2U);
}

TEST(UltrasoundPatches, LeastShareAndConstantUltrasoundDecideWhichCount) {
  BeamUltrasound us = noisy_ultrasound(downward_beams(8, 4, 4));  // two patches of 64
  us.known.assign(us.brightness.size(), 255);
  for (int l = 0; l < 4; ++l)
    for (int s = 0; s < 3; ++s)
      for (int f = 0; f < 4; ++f) us.known[offset_of(us.beams, s, l, f)] = 0;
  PatchOptions options = cubes(4.0);
  options.least_share = 0.25;
  EXPECT_EQ(cut_into_patches(us, options).patches.size(), 2U);
  options.least_share = 0.26;
  EXPECT_EQ(cut_into_patches(us, options).patches.size(), 1U);
  us.known.clear();
  for (int beam = 0; beam < 16; ++beam)
    for (int s = 4; s < 8; ++s) us.brightness[offset_of(us.beams, s, beam % 4, beam / 4)] = 77.7F;
  const UltrasoundPatches patches = cut_into_patches(us, cubes(4.0));
  ASSERT_EQ(patches.patches.size(), 1U);
  EXPECT_EQ(patches.count, 64U);
  us.brightness.assign(us.brightness.size(), 5.0F);
  EXPECT_TRUE(cut_into_patches(us, cubes(4.0)).patches.empty());
}

/// Sample, line and frame of every sample that counts.
std::set<std::array<int, 3>> counting(const BeamUltrasound& us, const PatchOptions& options) {
  const UltrasoundPatches patches = cut_into_patches(us, options);
  const auto places = places_of(us.beams);
  std::set<std::array<int, 3>> result;
  for (std::size_t place = 0; place < patches.value.size(); ++place)
    if (!is_filled_up(patches, place)) {
      const Eigen::Vector3i at = places.at(position_at(patches, place));
      result.insert({at.x(), at.y(), at.z()});
    }
  EXPECT_EQ(result.size(), patches.count);
  return result;
}

/// A face-centred lattice: sample, line and frame sum to an even number.
TEST(UltrasoundPatches, HalfOfTheSamplesAreEveryOtherOneWhateverThePatches) {
  const BeamUltrasound us = noisy_ultrasound(downward_beams(9, 9, 9));
  for (const double edge : {9.0, 3.0}) {
    PatchOptions options = cubes(edge);
    options.least_share = 1.0;
    EXPECT_EQ(counting(us, options).size(), 729U);
    options.samples = SampleSubset::kHalf;
    const auto half = counting(us, options);
    EXPECT_EQ(half.size(), 365U);
    for (const auto& at : half) EXPECT_EQ((at[0] + at[1] + at[2]) % 2, 0);
  }
}

/// Neighbouring lines and frames have their samples at other depths, so that every plane of the
/// field is seen.
TEST(UltrasoundPatches, AQuarterOfTheSamplesIsEveryFourthOneOfALineStaggered) {
  const BeamUltrasound us = noisy_ultrasound(downward_beams(16, 8, 8));
  for (const double edge : {16.0, 4.0}) {
    PatchOptions options = cubes(edge);
    options.samples = SampleSubset::kQuarter;
    const auto quarter = counting(us, options);
    EXPECT_EQ(quarter.size(), 256U);
    for (int beam = 0; beam < 64; ++beam)
      for (int first = 0; first < 16; first += 4) {
        int here = 0;
        for (int s = first; s < first + 4; ++s)
          here += static_cast<int>(quarter.count({s, beam % 8, beam / 8}));
        EXPECT_EQ(here, 1) << "line " << beam % 8 << ", frame " << beam / 8;
      }
    for (int s = 0; s < 16; ++s) {
      int in_plane = 0;
      for (int beam = 0; beam < 64; ++beam)
        in_plane += static_cast<int>(quarter.count({s, beam % 8, beam / 8}));
      EXPECT_EQ(in_plane, 16) << "sample " << s;
    }
  }
}

TEST(UltrasoundPatches, LeastShareIsOfTheSamplesThatCount) {
  BeamUltrasound us = noisy_ultrasound(downward_beams(8, 8, 8));
  us.known.assign(us.brightness.size(), 0);
  for (int beam = 0; beam < 64; ++beam)
    for (int s = 0; s < 4; ++s) us.known[offset_of(us.beams, s, beam % 8, beam / 8)] = 1;
  PatchOptions options = cubes(4.0);
  options.samples = SampleSubset::kHalf;
  options.least_share = 1.0;
  EXPECT_EQ(counting(us, options).size(), 128U);
  us.known[offset_of(us.beams, 0, 0, 0)] = 0;
  EXPECT_EQ(counting(us, options).size(), 96U);
}

/// A sweep by a swinging array with evenly spaced tables of angles.
ScanGeometry swinging(double scale, double depth_scale) {
  ScanGeometry geometry;
  geometry.axial = {30, 5.0 * depth_scale, 3.0 * depth_scale};
  geometry.array = CurvilinearArray{40.0, centred_table(16, 0.05)};
  geometry.motion = MotorSweep{27.0, centred_table(41, 0.0128 * scale), 0.0};
  return geometry;
}

/// The greatest error of the motion, as a share of the greatest motion.
double motion_error(const BeamGrid& beams, const BeamGrid& scaled, double error) {
  const UltrasoundPatches us = cut_into_patches(noisy_ultrasound(beams), cubes(10.0));
  const auto places = places_of(beams);
  double worst = 0.0;
  double greatest = 0.0;
  for (std::size_t place = 0; place < us.value.size(); ++place) {
    if (is_filled_up(us, place)) continue;
    const Eigen::Vector3i at = places.at(position_at(us, place));
    const Eigen::Vector3d expected =
        (scaled.point(at.z(), at.y(), at.x()) - beams.point(at.z(), at.y(), at.x())) / error;
    const Eigen::Vector3d motion(us.sweep_x[place], us.sweep_y[place], us.sweep_z[place]);
    worst = std::max(worst, (motion - expected).norm());
    greatest = std::max(greatest, expected.norm());
  }
  return worst / greatest;
}

TEST(UltrasoundPatches, MoveWithErrorsOfTheSweepAsTheMotorDoes) {
  constexpr double kError = 1e-5;
  EXPECT_LT(
      motion_error(beam_grid(swinging(1.0, 1.0)), beam_grid(swinging(1.0 + kError, 1.0)), kError),
      0.01);
}

TEST(UltrasoundPatches, MoveWithErrorsOfAStraightSweepExactly) {
  const BeamGrid beams = downward_beams(12, 6, 25);
  BeamGrid scaled = beams;
  for (Beam& beam : scaled.beams) beam.origin_mm.z() *= 1.1;
  EXPECT_LT(motion_error(beams, scaled, 0.1), 1e-6);
}

/// A motor whose steps are `before` and `after` times as long as recorded on the two sides of the
/// middle, as that of the scanner in the thesis (section 3.1.6).
TEST(UltrasoundPatches, LieWhereAMotorThatIsSlowOnOneSideTookThem) {
  const ScanGeometry recorded = swinging(1.0, 1.0);
  for (const auto& [before, after] : {std::pair(0.836, 1.02), std::pair(1.0, 0.85)}) {
    ScanGeometry moved = recorded;
    for (double& angle : std::get<MotorSweep>(moved.motion).frame_angles_rad)
      angle *= angle < 0.0 ? before : after;
    const AcquisitionErrors errors{0.0, 0.5 * (after + before) - 1.0, 0.5 * (after - before)};
    EXPECT_GT(greatest_distance_mm(beam_grid(recorded), beam_grid(moved)), 3.0);
    EXPECT_LT(greatest_distance_mm(with_sweep(beam_grid(recorded), errors), beam_grid(moved)), 0.1);
  }
}

TEST(UltrasoundPatches, MoveWithAnUnevenStraightSweepExactly) {
  const BeamGrid beams = downward_beams(12, 6, 25);
  const BeamGrid moved = with_sweep(beams, {0.0, 0.02, 0.08});
  BeamGrid expected = beams;
  for (Beam& beam : expected.beams) beam.origin_mm.z() *= beam.origin_mm.z() < 0.0 ? 0.94 : 1.1;
  EXPECT_LT(greatest_distance_mm(moved, expected), 1e-9);
  const UltrasoundPatches us = cut_into_patches(noisy_ultrasound(beams), cubes(10.0));
  const auto places = places_of(beams);
  for (std::size_t place = 0; place < us.value.size(); ++place) {
    if (is_filled_up(us, place)) continue;
    const Eigen::Vector3i at = places.at(position_at(us, place));
    const double error = 0.02 + 0.08 * us.sweep_side[place];
    EXPECT_NEAR(us.z_mm[place] + error * us.sweep_z[place],
                expected.point(at.z(), at.y(), at.x()).z(), 1e-4);
  }
}

TEST(UltrasoundPatches, OfFewOrRestingFramesDoNotMove) {
  for (const int frames : {1, 2, 3, 4}) {
    const BeamGrid beams = downward_beams(12, 6, frames);
    BeamGrid scaled = beams;
    for (Beam& beam : scaled.beams) beam.origin_mm.z() *= 1.1;
    if (frames > 1) {
      EXPECT_LT(motion_error(beams, scaled, 0.1), 1e-6) << frames;
    }
    BeamUltrasound resting = noisy_ultrasound(beams);
    for (Beam& beam : resting.beams.beams) beam.origin_mm.z() = 0.0;
    const UltrasoundPatches us = cut_into_patches(resting, cubes(4.0));
    for (const float motion : us.sweep_z) EXPECT_EQ(motion, 0.0F);
    EXPECT_LT(greatest_distance_mm(with_sweep(resting.beams, {0.0, 0.1, 0.1}), resting.beams),
              1e-9);
  }
}

/// The middle line of 90 frames stays where it is; patches of all of them would mix what lies at
/// all angles. Frames lie 0.28 mm apart halfway to the sides.
TEST(UltrasoundPatches, OfASweepThatTurnsAboutItsMiddleLineHaveFramesThatLieTogether) {
  const BeamUltrasound us = noisy_ultrasound(turning_sweep(12, 31, 90, 0.035));
  const UltrasoundPatches patches = cut_into_patches(us, cubes(8.0));
  const auto places = places_of(us.beams);
  for (const UltrasoundPatches::Patch& patch : patches.patches) {
    int first = us.beams.frames;
    int last = 0;
    for (const std::size_t place : places_of(patches, patch)) {
      const auto at = places.find(position_at(patches, place));
      if (at == places.end() || at->second.y() == us.beams.lines / 2) continue;
      first = std::min(first, at->second.z());
      last = std::max(last, at->second.z());
    }
    EXPECT_LT(last - first, 29);
  }
}

TEST(UltrasoundPatches, AreTheSameBitsForAnyNumberOfThreads) {
  const BeamUltrasound us = noisy_ultrasound(beam_grid(swinging(1.0, 1.0)));
  const auto cut = [&] { return cut_into_patches(us, cubes(8.0)); };
  const UltrasoundPatches one = with_threads(1, cut);
  const UltrasoundPatches three = with_threads(3, cut);
  EXPECT_EQ(one.x_mm, three.x_mm);
  EXPECT_EQ(one.value, three.value);
  EXPECT_EQ(one.sweep_y, three.sweep_y);
  EXPECT_EQ(one.patches.size(), three.patches.size());
}

TEST(UltrasoundPatches, WithoutBeamsServeWhatNeedsNone) {
  const BeamUltrasound us = noisy_ultrasound(downward_beams(20, 9, 5));
  const auto ct = std::make_shared<const PackedCt>(
      wavy_ct(oblique_grid({30, 30, 30}, {1.0, 1.0, 1.0})), kWindow, kBackgroundHu);
  LocalLc2Options options;
  options.patches = cubes(4.0);
  const auto made = [&](bool with_beams, const SimilarityBackend& backend) {
    SimilarityImages images(std::make_shared<const BeamUltrasound>(us), ct, nullptr, with_beams,
                            backend);
    return make_similarity(images, options);
  };
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const double value = value_at(*made(true, simd_backend()), pose).value;
  EXPECT_GT(value, 0.0);
  for (const SimilarityBackend* backend : {&simd_backend(), &scalar_backend()}) {
    options.channel = GradientChannel::kMagnitude;
    const auto similarity = made(false, *backend);
    EXPECT_NEAR(value_at(*similarity, pose).value, value, 1e-6);
    EXPECT_THROW(value_at(*similarity, pose, {0.01, 0.0}), InputError);
    EXPECT_THROW(value_at(*similarity, pose, {0.0, 0.01}), InputError);
    options.channel = GradientChannel::kAlongBeam;
    EXPECT_THROW(value_at(*made(false, *backend), pose), InputError);
  }
}

TEST(UltrasoundPatches, AreJudgedWithTheSameBitsForAnyNumberOfThreads) {
  LocalLc2Options options;
  options.patches = cubes(3.0);
  options.power = 2.0;
  const auto similarity =
      similarity_of(noisy_ultrasound(downward_beams(77, 64, 40)),
                    wavy_ct(oblique_grid({60, 60, 60}, {1.3, 1.3, 1.3})), options);
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const auto value = [&] { return value_at(*similarity, pose); };
  const SimilarityValue one = with_threads(1, value);
  const SimilarityValue three = with_threads(3, value);
  EXPECT_GT(one.overlap, 0.1);
  EXPECT_EQ(one.value, three.value);
  EXPECT_EQ(one.overlap, three.overlap);
}

TEST(UltrasoundPatches, RefusesOptionsThatAreWrong) {
  const BeamUltrasound us = noisy_ultrasound(downward_beams(8, 4, 4));
  for (const PatchOptions& options :
       {PatchOptions{0.0, 4.0, 4.0, 0.5}, PatchOptions{4.0, -1.0, 4.0, 0.5},
        PatchOptions{4.0, 4.0, 0.0, 0.5}, PatchOptions{4.0, 4.0, 4.0, 0.0},
        PatchOptions{4.0, 4.0, 4.0, 1.1}})
    EXPECT_THROW(cut_into_patches(us, options), InputError);
}

}  // namespace
}  // namespace usct::test
