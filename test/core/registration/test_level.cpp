#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"
#include "registration/level.h"
#include "us_ct_registration/simulation/decimation.h"

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
  const auto error_mm = [](const std::string& spacing_mm) {
    const RegistrationResult result =
        registered(agar_case(), nearby(agar_case()),
                   quick_options("stages:\n  2:\n    spacing_mm: " + spacing_mm + "\n"));
    EXPECT_TRUE(result.T_us_ct) << result.message;
    return agar_case().error_mm(result.T_us_ct.value_or(Eigen::Isometry3d::Identity()));
  };
  // The same voxels are averaged, but over a region of its own.
  EXPECT_NEAR(error_mm("2"), error_mm("2.0001"), 0.2);
}

}  // namespace
}  // namespace usct::test
