#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "core/similarity/instructions.h"
#include "core/similarity/patch_scenes.h"
#include "similarity/joint_sums.h"
#include "similarity/patch_kernel.h"

namespace usct::test {
namespace {

struct Scene {
  UltrasoundPatches us;
  PackedCt ct;
  PatchKernelInput input(const Eigen::Isometry3d& T_ct_us, const AcquisitionErrors& errors,
                         GradientChannel channel) const {
    return kernel_input(us, ct, {T_ct_us, errors}, channel);
  }
};

/// A scene of patches of random size with holes, and a CT that ends among them.
Scene random_scene() {
  BeamUltrasound us =
      noisy_ultrasound(downward_beams(integer(5, 40), integer(3, 20), integer(2, 9)));
  if (*rc::gen::arbitrary<bool>())
    for (std::size_t i = 0; i < us.brightness.size(); ++i) us.known.push_back(hashed(i) > 15000.0);
  PatchOptions patches{uniform(1.0, 9.0), uniform(1.0, 9.0), uniform(1.0, 9.0), 0.3,
                       SampleSubset::kAll};
  if (integer(0, 4) == 0) patches = PatchOptions::whole();
  const Grid grid = oblique_grid({integer(10, 40), integer(10, 40), integer(10, 40)},
                                 {uniform(0.5, 1.5), uniform(0.5, 1.5), uniform(0.5, 1.5)});
  return {cut_into_patches(us, patches), PackedCt(wavy_ct(grid), kWindow, kBackgroundHu)};
}

Eigen::Isometry3d random_kernel_pose() {
  return random_small_pose(3.0, integer(0, 4) == 0 ? 200.0 : 10.0);
}

/// A sample on the border of a cell may be rounded into either, which changes the gradient.
constexpr double kOnBorders = 0.01;

bool close(const StrandSums& a, const StrandSums& b, std::size_t i, double rows) {
  const auto near = [&](const float* x, const float* y, double tolerance) {
    return std::abs(static_cast<double>(x[i]) - static_cast<double>(y[i])) <=
           tolerance * rows + 1e-5 * std::abs(static_cast<double>(y[i]));
  };
  return a.inside[i] == b.inside[i] && near(a.m, b.m, 2e-3) && near(a.g, b.g, 4e-3) &&
         near(a.mm, b.mm, 0.3) && near(a.gg, b.gg, 0.6) && near(a.mg, b.mg, 0.6) &&
         near(a.um, b.um, 0.06) && near(a.ug, b.ug, 0.12);
}

RC_GTEST_PROP(PatchKernel, SumsAreTheReferenceWithAllInstructions, ()) {
  const Scene scene = random_scene();
  RC_PRE(!scene.us.patches.empty());
  const auto channel =
      *rc::gen::arbitrary<bool>() ? GradientChannel::kMagnitude : GradientChannel::kAlongBeam;
  AcquisitionErrors errors;
  if (*rc::gen::arbitrary<bool>())
    errors = {uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1)};
  const PatchKernelInput input = scene.input(random_kernel_pose(), errors, channel);
  const std::size_t blocks = scene.us.blocks.size();
  const auto first = static_cast<std::size_t>(integer(0, static_cast<int>(blocks)));
  std::vector<StrandSums> expected(blocks - first);
  sum_strands_scalar(input, first, blocks, expected.data());
  for (const std::int64_t target : Instructions::all()) {
    const Instructions instructions(target);
    std::vector<StrandSums> sums(blocks - first);
    sum_strands_simd(input, first, blocks, sums.data());
    double differ = 0.0;
    for (std::size_t b = 0; b < sums.size(); ++b)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        differ +=
            close(sums[b], expected[b], lane, static_cast<double>(scene.us.blocks[first + b].rows))
                ? 0.0
                : 1.0;
    RC_ASSERT(differ <= std::max(1.0, kOnBorders * static_cast<double>(sums.size() * kLanes)));
  }
}

RC_GTEST_PROP(PatchKernel, ValuesAreTheReferenceWithAllInstructions, ()) {
  const Scene scene = random_scene();
  RC_PRE(!scene.us.patches.empty());
  const AcquisitionErrors errors{uniform(-0.1, 0.1), 0.0, uniform(-0.1, 0.1)};
  const PatchKernelInput input =
      scene.input(random_kernel_pose(), errors, GradientChannel::kMagnitude);
  for (std::size_t b = 0; b < scene.us.blocks.size(); ++b) {
    const std::size_t count = scene.us.blocks[b].rows * kLanes;
    std::vector<float> expected(count), values(count);
    const std::size_t inside = sample_block_scalar(input, b, expected.data());
    for (const std::int64_t target : Instructions::all()) {
      const Instructions instructions(target);
      const std::size_t other = sample_block_simd(input, b, values.data());
      int differ = 0;
      for (std::size_t i = 0; i < count; ++i)
        differ += std::abs(values[i] - expected[i]) > 2e-3F ? 1 : 0;
      RC_ASSERT(differ <= 1);
      RC_ASSERT(std::max(other, inside) - std::min(other, inside) <= 1);
    }
  }
}

RC_GTEST_PROP(PatchKernel, JointSumsAreTheReferenceWithAllInstructions, ()) {
  const Scene scene = random_scene();
  RC_PRE(!scene.us.patches.empty());
  std::vector<float> ultrasound(scene.us.value.begin(), scene.us.value.end());
  for (std::size_t place = 0; place < ultrasound.size(); ++place)
    if (scene.us.x_mm[place] == UltrasoundPatches::kNowhere) ultrasound[place] = std::nanf("");
  const AcquisitionErrors errors{*rc::gen::arbitrary<bool>() ? 0.0 : uniform(-0.1, 0.1), 0.0};
  const JointSumsInput input{scene.input(random_kernel_pose(), errors, GradientChannel::kMagnitude),
                             ultrasound.data(), integer(8, 65), integer(2, 33),
                             uniform(5.0, 100.0)};
  const JointSums expected = joint_sums_scalar(input);
  double count = 0.0;
  for (const double c : expected.count) count += c;
  RC_ASSERT(std::abs(count - static_cast<double>(scene.us.count)) < 1e-3);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions instructions(target);
    const JointSums sums = joint_sums_simd(input);
    RC_ASSERT(std::abs(sums.inside - expected.inside) <= 2.0);
    double counts = 0.0, values = 0.0;
    for (std::size_t knot = 0; knot < sums.count.size(); ++knot) {
      counts += std::abs(sums.count[knot] - expected.count[knot]);
      values += std::abs(sums.ultrasound[knot] - expected.ultrasound[knot]);
    }
    RC_ASSERT(counts < 1e-3 * static_cast<double>(scene.us.count) + 2.0);
    RC_ASSERT(values < 2e-2 * static_cast<double>(scene.us.count) + 100.0);
  }
}

/// Fills a lane with the sums of a few random samples.
void fill_lane(StrandSums& sums, std::size_t lane, double& count, double& uu) {
  const int samples = integer(0, 20);
  const bool constant = integer(0, 5) == 0;
  std::vector<float> u;
  u.reserve(static_cast<std::size_t>(samples));
  float mean = 0.0F;
  for (int i = 0; i < samples; ++i) u.push_back(static_cast<float>(uniform(-30, 30)));
  for (const float value : u) mean += value / static_cast<float>(samples);
  const double slope = uniform(-2.0, 2.0);
  const double m0 = uniform(-100.0, 100.0);
  count = samples;
  for (int i = 0; i < samples; ++i) {
    const float value = u[static_cast<std::size_t>(i)] - mean;
    const auto m = static_cast<float>(m0 + (constant ? 0.0 : slope * value + uniform(-20, 20)));
    const auto g = static_cast<float>(constant ? 0.0 : std::abs(uniform(-20, 20) - slope * value));
    uu += static_cast<double>(value) * value;
    sums.m[lane] += m;
    sums.g[lane] += g;
    sums.mm[lane] += m * m;
    sums.gg[lane] += g * g;
    sums.mg[lane] += m * g;
    sums.um[lane] += value * m;
    sums.ug[lane] += value * g;
  }
}

RC_GTEST_PROP(PatchKernel, ExplainedSharesAreTheReferenceWithAllInstructions, ()) {
  StrandSums sums{};
  double count[kLanes] = {};
  double uu[kLanes] = {};
  for (std::size_t lane = 0; lane < kLanes; ++lane) fill_lane(sums, lane, count[lane], uu[lane]);
  Lc2Ridge ridge{uniform(0.0, 20.0), uniform(0.0, 40.0), *rc::gen::arbitrary<bool>()};
  if (*rc::gen::arbitrary<bool>()) ridge.intensity = ridge.gradient = 0.0;
  double expected[kLanes];
  explained_shares_scalar(sums, count, uu, ridge, expected);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions instructions(target);
    double shares[kLanes];
    explained_shares_simd(sums, count, uu, ridge, shares);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      RC_ASSERT(std::abs(shares[lane] - expected[lane]) < 1e-9);
  }
}

}  // namespace
}  // namespace usct::test
