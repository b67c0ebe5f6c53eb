#include "study_options.h"

#include "us_ct_registration/error.h"

namespace usct::tools {
namespace {

constexpr double kDegree = 0.017453292519943295;

StageOptions stage(double spacing_mm, double patch_mm) {
  StageOptions stage;
  stage.spacing_mm = spacing_mm;
  stage.similarity.patches.depth_mm = patch_mm;
  stage.similarity.patches.lateral_mm = stage.similarity.patches.elevation_mm = 1.4 * patch_mm;
  stage.optimizer.method = OptimizerMethod::kBobyqa;
  stage.optimizer.max_evaluations = 300;
  stage.optimizer.initial_step = spacing_mm;
  stage.optimizer.step_tolerance = spacing_mm / 20.0;
  stage.optimizer.cost_tolerance = 1e-6;
  stage.reach_mm = 40.0;
  return stage;
}

RegistrationOptions three_stages() {
  RegistrationOptions options;
  options.window = {-150.0, 400.0};
  options.conditioning.smoothing_mm = 0.0;
  StageOptions coarse = stage(4.0, 16.0);
  coarse.starts = StartOptions{StartRegion::kBox, 1024, 25.0 * kDegree, 25.0};
  coarse.optimised = 16;
  coarse.kept = 8;
  StageOptions middle = stage(2.0, 8.0);
  middle.optimised = 8;
  middle.kept = 2;
  StageOptions fine = stage(1.0, 4.0);
  fine.optimised = fine.kept = 2;
  options.stages = {coarse, middle, fine};
  return options;
}

/// One start, one coarse stage.
RegistrationOptions fast() {
  RegistrationOptions options = three_stages();
  options.stages = {stage(4.0, 16.0)};
  options.stages.front().optimizer.max_evaluations = 60;
  return options;
}

}  // namespace

RegistrationOptions registration_options(const std::string& preset, const std::string& path) {
  if (!path.empty()) throw InputError("--options", "is not supported yet, must be left out");
  if (preset == "patient") return three_stages();
  if (preset == "fast") return fast();
  throw InputError("--preset", "is '" + preset + "', must be fast or patient");
}

}  // namespace usct::tools
