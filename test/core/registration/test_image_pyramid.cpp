#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"
#include "core/similarity/patch_scenes.h"
#include "registration/images/ct_averages.h"
#include "registration/images/image_pyramid.h"
#include "us_ct_registration/error.h"

namespace usct::test {
namespace {

using registration::CtInReach;
using registration::PreparedUltrasound;

TEST(ImagePyramid, SimilaritiesThatShareImagesAreThoseOfTheirOwnOptions) {
  const RegistrationOptions options = quick_options();
  const RegistrationCase& images = agar_case();
  const PreparedUltrasound prepared = registration::prepare_ultrasound(images.us, options);
  const LevelOptions& level = options.search.levels[1];
  const CtInReach reach =
      registration::ct_in_reach(images.ct, prepared.us->beams, images.T_us_ct_true, options.search);
  const auto packed =
      registration::packed_cts(images.ct, reach.region,
                               registration::steps_of({level}, images.ct.grid), options)
          .front();

  const auto& own = std::get<JointCorrelationRatioOptions>(level.similarity);
  LocalLc2Options other_metric;  // another metric in the same patches
  other_metric.patches = own.patches;
  JointCorrelationRatioOptions other_patches = own;
  other_patches.patches.depth_mm += 8.0;
  SimilarityImages shared(prepared.us, packed, nullptr);
  for (const SimilarityOptions& which :
       {SimilarityOptions(own), SimilarityOptions(other_metric), SimilarityOptions(other_patches),
        SimilarityOptions(other_metric)}) {
    SimilarityImages alone(prepared.us, packed, nullptr);
    const SimilarityPose pose{images.T_us_ct_true.inverse(), {}};
    EXPECT_EQ(make_similarity(shared, which)->evaluate(pose).value,
              make_similarity(alone, which)->evaluate(pose).value);
  }
}

TEST(ImagePyramid, ARefinementOnTheDecidingSpacingFindsWhatItWouldFindOnImagesOfItsOwn) {
  const auto found = [](const RegistrationCase& images, const std::string& spacing_mm) {
    const RegistrationResult result = registered(
        images, nearby(images), quick_options("refinement: {spacing_mm: " + spacing_mm + "}\n"));
    EXPECT_TRUE(result.T_us_ct) << result.message;
    return result.T_us_ct.value_or(Eigen::Isometry3d::Identity());
  };
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    // The same voxels are averaged for both cases, but over different regions.
    const double apart_mm =
        evaluate_targets(found(*images, "2"), found(*images, "2.0001"), images->targets_us_mm)
            .mean_mm;
    EXPECT_LT(apart_mm, 0.1);
  }
}

/// Noise in a cube of `edge` samples along each axis, 2 mm apart, and a CT around it.
RegistrationCase cube_of(int edge) {
  RegistrationCase images;
  BeamGrid beams = downward_beams(edge, edge, edge);
  beams.axial.spacing_mm = 2.0;
  for (Beam& beam : beams.beams) beam.origin_mm *= 2.0;
  images.us = noisy_ultrasound(beams);
  const Volume<float> waves = wavy_ct(oblique_grid({64, 64, 64}, {4.0, 4.0, 4.0}));
  images.ct.grid = waves.grid;
  images.ct.voxels.assign(waves.voxels.begin(), waves.voxels.end());
  return images;
}

/// 1.2 litres are 150,000 samples at 2 mm, and 18,750 at 4 mm.
TEST(ImagePyramid, ALargeFieldOfViewTakesFewerSamples) {
  const RegistrationOptions options = parse_registration_options(
      "preset: patient\nconditioning_spacing_mm: 2\n"
      "conditioning: {depth: {automatic: false}, no_contact_share: 0, shadow_share: 0}\n",
      "test");
  const RegistrationHooks hooks;
  const auto subsets_of = [&](int edge) {
    const RegistrationCase images = cube_of(edge);
    registration::Run run(hooks);
    const PreparedCt ct(images.ct);
    const Eigen::Isometry3d T_initial = Eigen::Isometry3d::Identity();
    const auto pyramid = registration::prepare({images.us, ct, T_initial, options}, run);
    EXPECT_TRUE(pyramid);
    std::vector<SampleSubset> subsets;
    const SimilarityPose pose{Eigen::Isometry3d(Eigen::Translation3d(1.0, 2.0, 3.0)), {}};
    for (std::size_t i = 0; i < pyramid->levels.size(); ++i)
      for (const SampleSubset subset :
           {SampleSubset::kAll, SampleSubset::kHalf, SampleSubset::kQuarter}) {
        const SimilarityOptions similarity =
            on_samples(options.search.levels[i].similarity, subset);
        if (make_similarity(*pyramid->levels[i].images, similarity)->evaluate(pose).value ==
            pyramid->levels[i].similarity->evaluate(pose).value) {
          subsets.push_back(std::get<JointCorrelationRatioOptions>(similarity).patches.samples);
          break;
        }
      }
    return subsets;
  };
  using Subsets = std::vector<SampleSubset>;
  const auto all = SampleSubset::kAll, half = SampleSubset::kHalf, quarter = SampleSubset::kQuarter;
  EXPECT_EQ(subsets_of(48), (Subsets{half, all}));         // 0.9 litres, as the options say
  EXPECT_EQ(subsets_of(60), (Subsets{half, half}));        // 1.7 litres
  EXPECT_EQ(subsets_of(76), (Subsets{quarter, quarter}));  // 3.5 litres
}

TEST(ImagePyramid, OptionsForParallelBeamsRefuseOthers) {
  const RegistrationOptions thesis_a = parse_registration_options(
      "preset: thesis_a\nsearch: {levels: {0: {optimizer: {max_evaluations: 3}}}}\n", "test");
  try {
    registered(agar_case(), nearby(agar_case()), thesis_a);
    FAIL() << "the true beams of a curvilinear probe are not parallel";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("--parallel-beams"), std::string::npos);
  }
  BeamOptions how;
  how.parallel_beams_mm = 3.0;
  const RegistrationCase parallel = case_of(agar_phantom(), agar_phantom().ultrasound, how);
  EXPECT_NO_THROW(registered(parallel, nearby(parallel), thesis_a));
}

}  // namespace
}  // namespace usct::test
