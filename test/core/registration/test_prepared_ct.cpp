#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/registration/registration_cases.h"
#include "registration/images/ct_averages.h"
#include "registration/images/reached_average.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/threads.h"

namespace usct::test {
namespace {

using Eigen::Vector3i;
using registration::averaged;
using registration::AveragingSteps;
using registration::packed_cts;
using registration::regions_over;
using registration::steps_of;
using registration::steps_to;

Vector3i random_size(int least, int most) {
  Vector3i size;
  for (int axis = 0; axis < 3; ++axis) size[axis] = *rc::gen::inRange(least, most + 1);
  return size;
}

Region random_region(const Vector3i& size) {
  Region region;
  for (int axis = 0; axis < 3; ++axis) {
    region.begin[axis] = *rc::gen::inRange(0, size[axis]);
    region.size[axis] = *rc::gen::inRange(1, size[axis] - region.begin[axis] + 1);
  }
  return region;
}

/// Voxels that have nothing to do with each other, beyond the window at both ends.
CtVolume noise_ct(const Vector3i& size) {
  CtVolume ct;
  ct.grid.size = size;
  for (int axis = 0; axis < 3; ++axis) ct.grid.spacing_mm[axis] = 0.01 * *rc::gen::inRange(30, 250);
  ct.grid.origin_mm = {3.7, -211.3, 0.1};
  ct.voxels.resize(ct.grid.voxel_count());
  std::uint32_t state = *rc::gen::arbitrary<std::uint32_t>();
  for (std::int16_t& hu : ct.voxels) {
    state = state * 1664525U + 1013904223U;
    hu = static_cast<std::int16_t>(static_cast<int>(state >> 22U) - 400);
  }
  return ct;
}

bool same_bits(const Grid& a, const Grid& b) {
  return a.size == b.size && a.spacing_mm == b.spacing_mm && a.origin_mm == b.origin_mm &&
         a.direction == b.direction;
}

RC_GTEST_PROP(CtAverages, OfARegionAreThoseOfTheWholeCt, ()) {
  const CtVolume ct = noise_ct(random_size(4, 40));
  const std::vector<AveragingSteps> steps = steps_of(RegistrationOptions().search.levels, ct.grid);
  const Region region = random_region(ct.grid.size);
  const std::vector<Region> regions = regions_over(region, steps, ct.grid);
  const std::vector<Volume<float>> parts = averaged(ct, steps, regions);
  const std::vector<Volume<float>> all =
      averaged(ct, steps, regions_over(whole(ct.grid), steps, ct.grid));
  for (std::size_t i = 0; i < steps.size(); ++i) {
    RC_ASSERT(parts[i].grid.size.minCoeff() >= 2);
    const Volume<float> expected = crop(all[i], regions[i]);
    RC_ASSERT(parts[i].voxels == expected.voxels);
    RC_ASSERT(same_bits(parts[i].grid, expected.grid));
  }
}

RC_GTEST_PROP(CtAverages, CoverTheRegion, ()) {
  const CtVolume ct = noise_ct(random_size(4, 40));
  const std::vector<AveragingSteps> steps = steps_of(RegistrationOptions().search.levels, ct.grid);
  const Region region = random_region(ct.grid.size);
  const std::vector<Region> regions = regions_over(region, steps, ct.grid);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    Vector3i block = Vector3i::Ones();
    for (const Vector3i& step : steps[i]) block = block.cwiseProduct(step);
    for (int axis = 0; axis < 3; ++axis) {
      // Voxels beyond the last whole block of the CT have no average.
      const int averaged_voxels = ct.grid.size[axis] / block[axis] * block[axis];
      const int begin = regions[i].begin[axis] * block[axis];
      const int end = begin + regions[i].size[axis] * block[axis];
      RC_ASSERT(begin <= region.begin[axis]);
      RC_ASSERT(end >= std::min(region.begin[axis] + region.size[axis], averaged_voxels));
    }
  }
}

/// The pairs and words of the voxels that have any.
std::pair<std::vector<std::uint16_t>, std::vector<std::uint32_t>> voxels_of(const PackedCt& ct) {
  std::pair<std::vector<std::uint16_t>, std::vector<std::uint32_t>> all;
  const Vector3i& size = ct.grid().size;
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j + 1 < size.y(); ++j) {
      const std::size_t row =
          static_cast<std::size_t>(j) * ct.stride_j() + static_cast<std::size_t>(k) * ct.stride_k();
      all.first.insert(all.first.end(), ct.pairs() + row, ct.pairs() + row + size.x());
      const std::uint32_t* words = ct.gradient().words + row;
      all.second.insert(all.second.end(), words, words + size.x());
    }
  return all;
}

RC_GTEST_PROP(PreparedCt, PacksTheSameBytesAsTheCt, ()) {
  const CtVolume ct = noise_ct(random_size(4, 40));
  RegistrationOptions options;
  options.window.low_hu = *rc::gen::inRange(-300, 0);
  options.search.levels.back().spacing_mm = *rc::gen::element(1.0, 2.0, 3.0);
  const PreparedCt prepared(ct, options);
  const Region region = random_region(ct.grid.size);
  std::vector<std::vector<AveragingSteps>> wanted{steps_of(options.search.levels, ct.grid)};
  wanted.push_back({steps_to(options.refinement->spacing_mm, ct.grid)});
  for (const std::vector<AveragingSteps>& steps : wanted) {
    const auto cut_out = packed_cts(prepared, region, steps, options);
    const auto made = packed_cts(ct, region, steps, options);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      RC_ASSERT(prepared.find(options.window, steps[i]) != nullptr);
      RC_ASSERT(voxels_of(*cut_out[i]) == voxels_of(*made[i]));
      RC_ASSERT(same_bits(cut_out[i]->grid(), made[i]->grid()));
      RC_ASSERT(cut_out[i]->background() == made[i]->background());
    }
  }
}

void expect_same(const RegistrationResult& a, const RegistrationResult& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.message, b.message);
  EXPECT_EQ(a.evaluations, b.evaluations);
  ASSERT_FALSE(a.candidates.empty()) << a.message;
  ASSERT_EQ(a.candidates.size(), b.candidates.size());
  for (std::size_t i = 0; i < a.candidates.size(); ++i) {
    EXPECT_EQ(a.candidates[i].T_us_ct.matrix(), b.candidates[i].T_us_ct.matrix());
    EXPECT_EQ(a.candidates[i].similarity, b.candidates[i].similarity);
  }
  EXPECT_EQ(a.measures.wrong_probability, b.measures.wrong_probability);
  EXPECT_EQ(a.measures.local_agreement, b.measures.local_agreement);
  EXPECT_EQ(a.measures.rival_advantage, b.measures.rival_advantage);
}

TEST(PreparedCt, ChangesNoBitOfAResult) {
  const RegistrationCase& images = patient_case();
  const RegistrationOptions options = quick_options();
  const PreparedCt prepared(images.ct, options);
  expect_same(register_ultrasound(images.us, prepared, nearby(images), options),
              registered(images, nearby(images), options));
}

TEST(PreparedCt, ChangesNoBitOfAResultWhateverWasRegisteredBefore) {
  const RegistrationCase& images = patient_case();
  const RegistrationOptions options = quick_options();
  const PreparedCt prepared(images.ct, options);
  const std::size_t memory = prepared.bytes();
  const Eigen::Isometry3d elsewhere = Eigen::Translation3d(15.0, -20.0, 10.0) * nearby(images);
  register_ultrasound(images.us, prepared, elsewhere, options);
  EXPECT_GT(prepared.bytes(), memory);  // what was reached is kept
  expect_same(register_ultrasound(images.us, prepared, nearby(images), options),
              registered(images, nearby(images), options));
}

TEST(PreparedCt, LeavesTheCtOfOtherOptionsToTheRegistration) {
  const RegistrationCase& images = agar_case();
  const PreparedCt prepared(images.ct, quick_options());
  const RegistrationOptions options = quick_options("window: {low_hu: -100, high_hu: 350}\n");
  expect_same(register_ultrasound(images.us, prepared, nearby(images), options),
              registered(images, nearby(images), options));
}

TEST(PreparedCt, HasTheSameBytesWithAnyNumberOfThreads) {
  const RegistrationOptions options = quick_options();
  std::vector<std::unique_ptr<PreparedCt>> prepared;
  for (const int count : {1, 3}) {
    const ThreadCount threads(count);
    prepared.push_back(std::make_unique<PreparedCt>(agar_case().ct, options));
  }
  for (const AveragingSteps& steps : steps_of(options.search.levels, agar_case().ct.grid))
    EXPECT_EQ(prepared[0]->find(options.window, steps)->bytes().voxels,
              prepared[1]->find(options.window, steps)->bytes().voxels);
}

TEST(PreparedCt, TakesAByteForEachVoxelOfEachSpacing) {
  CtVolume ct;
  ct.grid.size = {40, 40, 40};  // of 1 mm: the refinement's spacing; the levels have 2 and 4 mm
  ct.voxels.resize(ct.grid.voxel_count());
  EXPECT_EQ(PreparedCt(ct).bytes(), 0U);
  EXPECT_EQ(PreparedCt(ct, RegistrationOptions()).bytes(), 64000U + 8000U + 1000U);
}

TEST(PreparedCt, HoldsWhatThePresetPatientLooksAtWhereDoubtsAreLeftToIt) {
  CtVolume ct;
  ct.grid.size = {40, 40, 40};
  ct.voxels.resize(ct.grid.voxel_count());
  RegistrationOptions fast = preset("fast");  // refines on 2 mm, and `patient` on 1 mm
  EXPECT_EQ(PreparedCt(ct, fast).bytes(), 64000U + 8000U + 1000U);
  fast.confidence.evidence = EvidenceSource::kOwn;
  EXPECT_EQ(PreparedCt(ct, fast).bytes(), 8000U + 1000U);
}

TEST(PreparedCt, PreparationIsCancelledBetweenParts) {
  struct Cancelled {};
  int calls = 0;
  const auto check = [&] {
    if (++calls == 3) throw Cancelled{};
  };
  EXPECT_THROW(PreparedCt(agar_case().ct, quick_options(), check), Cancelled);
}

TEST(PreparedCt, RefusesACtWithoutVoxels) {
  CtVolume ct = agar_case().ct;
  ct.voxels.pop_back();
  EXPECT_THROW(PreparedCt(ct, quick_options()), InputError);
}

}  // namespace
}  // namespace usct::test
