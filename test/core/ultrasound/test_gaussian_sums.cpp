#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/simulation/simple_scenes.h"
#include "core/ultrasound/sample_index.h"
#include "ultrasound/gaussian_sums.h"

namespace usct::test {
namespace {

/// A fan whose lines and frames are 0.8 to 3 mm apart.
BeamGrid fan(int samples = 61) {
  ScanGeometry geometry;
  geometry.axial = {samples, 2.0, 1.3};
  geometry.array = CurvilinearArray{40.0, centred_table(35, 0.02)};
  geometry.motion = MotorSweep{27.0, centred_table(31, 0.025), 0.0};
  return beam_grid(geometry);
}

/// Smooth structure and noise, with holes.
struct Masked {
  std::vector<float> values, mask;
};

Masked masked_values(const BeamGrid& beams) {
  Masked result;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s) {
        const std::size_t i = at(beams, s, l, f);
        const bool known = (s + l) % 9 != 0 && !(s > 20 && s < 35 && l < 12);
        result.mask.push_back(known ? 1.0F : 0.0F);
        const double value = std::sin(0.1 * s + 0.2 * l) + std::cos(0.15 * f - 0.1 * l) +
                             static_cast<double>((i * 7919) % 61) / 30.0;
        result.values.push_back(known ? static_cast<float>(value) : 0.0F);
      }
  return result;
}

/// The mean under a Gaussian of distances along the axes, by its definition.
double mean_by_definition(const BeamGrid& beams, const Masked& us, double sigma_mm,
                          const Eigen::Vector3i& place) {
  const auto path_mm = [](int from, int to, const auto& point_at) {
    double sum = 0.0;
    for (int i = std::min(from, to); i < std::max(from, to); ++i)
      sum += (point_at(i + 1) - point_at(i)).norm();
    return sum;
  };
  // Distances across lines and frames are those at the depth of the added sample, as for sums along
  // one axis after another.
  double sum = 0.0;
  double weight = 0.0;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l) {
      const double across2 =
          std::pow(path_mm(l, place.y(),
                           [&](int i) { return beams.point(beams.frames / 2, i, place.x()); }),
                   2.0) +
          std::pow(path_mm(f, place.z(),
                           [&](int i) { return beams.point(i, beams.lines / 2, place.x()); }),
                   2.0);
      for (int s = 0; s < beams.samples(); ++s) {
        const double along = (s - place.x()) * beams.axial.spacing_mm;
        const double w = std::exp(-0.5 * (across2 + along * along) / (sigma_mm * sigma_mm));
        sum += w * us.values[at(beams, s, l, f)];
        weight += w * us.mask[at(beams, s, l, f)];
      }
    }
  return sum / weight;
}

/// The greatest error of local means, in standard deviations of the averaged values.
double greatest_error(double sigma_mm) {
  const BeamGrid beams = fan();
  const Masked us = masked_values(beams);
  const GaussianSums sums(beams, sigma_mm);
  const std::vector<float> values = sums(us.values);
  const std::vector<float> weights = sums(us.mask);
  double worst = 0.0;
  for (int f = 0; f < beams.frames; f += 6)
    for (int l = 0; l < beams.lines; l += 17)
      for (int s = 0; s < beams.samples(); s += 20) {
        const std::size_t i = at(beams, s, l, f);
        const double expected = mean_by_definition(beams, us, sigma_mm, {s, l, f});
        worst = std::max(worst, std::abs(values[i] / weights[i] - expected));
      }
  return worst;
}

TEST(GaussianSums, OfNarrowWindowsAreThoseOfTheDefinition) {
  for (const double sigma_mm : {1.0, 1.5}) EXPECT_LT(greatest_error(sigma_mm), 0.02) << sigma_mm;
}

TEST(GaussianSums, OfWideWindowsAreInterpolatedToAFewPercent) {
  for (const double sigma_mm : {4.0, 8.0, 12.0})
    EXPECT_LT(greatest_error(sigma_mm), 0.06) << sigma_mm;
}

TEST(GaussianSums, OfWindowsFarWiderThanTheFieldAreThoseOfAllSamples) {
  const BeamGrid beams = fan(200);  // more than a block
  const Masked us = masked_values(beams);
  const double mean = std::accumulate(us.values.begin(), us.values.end(), 0.0) /
                      std::accumulate(us.mask.begin(), us.mask.end(), 0.0);
  for (const double sigma_mm : {1e6, 1e12, 1e200}) {
    const GaussianSums sums(beams, sigma_mm);
    const std::vector<float> values = sums(us.values);
    const std::vector<float> weights = sums(us.mask);
    for (const std::size_t i : {std::size_t{0}, values.size() / 2, values.size() - 1})
      EXPECT_NEAR(values[i] / weights[i], mean, 1e-3) << sigma_mm;
  }
}

TEST(GaussianSums, OfSeveralArraysAreThoseOfEachToTheBit) {
  const BeamGrid beams = fan();
  const Masked us = masked_values(beams);
  const std::vector<std::vector<float>> arrays{us.values, us.mask, us.values, us.mask, us.values};
  for (const double sigma_mm : {1.5, 8.0}) {
    const GaussianSums sums(beams, sigma_mm);
    const std::vector<float> values = sums(us.values);
    const std::vector<float> weights = sums(us.mask);
    std::vector<int> used(beams.beams.size());
    const auto samples = static_cast<std::size_t>(beams.samples());
    const auto fill = [&](int frame, int line, float* const* rows) {
      for (std::size_t array = 0; array < arrays.size(); ++array)
        std::copy_n(arrays[array].begin() + static_cast<std::ptrdiff_t>(at(beams, 0, line, frame)),
                    samples, rows[array]);
    };
    sums(arrays.size(), fill, [&](int frame, int line, const float* const* rows) {
      const std::size_t start = at(beams, 0, line, frame);
      ++used[start / samples];
      for (std::size_t array = 0; array < arrays.size(); ++array)
        for (std::size_t s = 0; s < samples; ++s)
          EXPECT_EQ(rows[array][s], (array % 2 == 0 ? values : weights)[start + s]);
    });
    EXPECT_EQ(used, std::vector<int>(beams.beams.size(), 1));
  }
}

TEST(GaussianSums, OfOneLineOrFrame) {
  BeamGrid beams = downward_beams(40, 1, 1);
  std::vector<float> values(40, 0.0F);
  values[20] = 1.0F;
  for (const double sigma_mm : {1.0, 10.0}) {
    const std::vector<float> sums = GaussianSums(beams, sigma_mm)(values);
    double weight = 0.0, moment = 0.0;
    for (int s = 0; s < 40; ++s) {
      weight += sums[static_cast<std::size_t>(s)];
      moment += sums[static_cast<std::size_t>(s)] * std::pow(s - 20.0, 2.0);
    }
    const double seen = sigma_mm < 5.0 ? 1.0 : 0.7;  // wide ones are cut off by the ends
    EXPECT_GT(moment / weight, seen * 0.9 * sigma_mm * sigma_mm);
    EXPECT_LT(moment / weight, 1.02 * sigma_mm * sigma_mm);
  }
}

}  // namespace
}  // namespace usct::test
