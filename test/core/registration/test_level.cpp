#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"
#include "registration/level.h"
#include "us_ct_registration/ultrasound/decimation.h"

namespace usct::test {
namespace {

using registration::LevelImages;
using registration::PreparedUltrasound;

TEST(Level, SimilaritiesThatShareImagesAreThoseOfTheirOwnOptions) {
  const RegistrationOptions options = quick_options();
  const RegistrationCase& images = agar_case();
  const PreparedUltrasound prepared = registration::prepare_ultrasound(images.us, options);
  const StageOptions& stage = options.stages[1];
  const Volume<float> ct = registration::ct_level(
      registration::ct_in_reach(images.ct, prepared.us.beams, images.T_us_ct_true, options), stage);

  SimilarityOptions other_kind = stage.similarity;  // in the same patches
  other_kind.kind = SimilarityKind::kLocalLc2;
  SimilarityOptions other_patches = stage.similarity;
  other_patches.patches.depth_mm += 8.0;
  LevelImages shared(stage, prepared, ct, options);
  for (const SimilarityOptions& which : {stage.similarity, other_kind, other_patches, other_kind}) {
    const auto alone = make_patch_similarity(
        std::make_shared<const UltrasoundPatches>(cut_into_patches(
            decimate(prepared.us, factors_for_spacing(prepared.us.beams, stage.spacing_mm)),
            which.patches)),
        std::make_shared<const PackedCt>(ct, options.window, options.outside_hu), which);
    const Eigen::Isometry3d T_ct_us = images.T_us_ct_true.inverse();
    EXPECT_EQ(shared.similarity(which)->evaluate(T_ct_us).value, alone->evaluate(T_ct_us).value);
  }
}

TEST(Level, LastStageOnTheDecisiveSpacingFindsWhatItWouldFindOnImagesOfItsOwn) {
  const auto found = [](const RegistrationCase& images, const std::string& spacing_mm) {
    const RegistrationResult result =
        registered(images, nearby(images),
                   quick_options("stages:\n  2:\n    spacing_mm: " + spacing_mm + "\n"));
    EXPECT_TRUE(result.T_us_ct) << result.message;
    return result.T_us_ct.value_or(Eigen::Isometry3d::Identity());
  };
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    // The same voxels are averaged for both, but over other regions.
    const double apart_mm =
        evaluate_targets(found(*images, "2"), found(*images, "2.0001"), images->targets_us_mm)
            .mean_mm;
    EXPECT_LT(apart_mm, 0.1);
  }
}

}  // namespace
}  // namespace usct::test
