#include "us_ct_registration/ultrasound/conditioning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "parallel.h"
#include "require.h"
#include "ultrasound/exclusion.h"
#include "ultrasound/gaussian_sums.h"
#include "ultrasound/square_roots.h"

namespace usct {
namespace {

/// Samples whose standard deviation is below this share of their mean are constant but for
/// rounding.
constexpr double kConstantShare = 1e-7;

/// Mean and standard deviation of the samples that count.
struct Statistics {
  double mean = 0.0;
  double deviation = 0.0;
};

Statistics statistics(const ConditionedUltrasound& us) {
  const auto sum_of = [&](const auto& term) {
    return parallel_sum(us.samples.size(), [&](std::size_t begin, std::size_t end) {
      // Additions to one sum would wait for each other.
      constexpr std::size_t kSums = 8;
      std::array<double, kSums> sums{};
      const auto add = [&](std::size_t sum, std::size_t i) {
        sums[sum] += us.reasons[i] == 0 ? term(static_cast<double>(us.samples[i])) : 0.0;
      };
      std::size_t i = begin;
      for (; i + kSums <= end; i += kSums)
        for (std::size_t sum = 0; sum < kSums; ++sum) add(sum, i + sum);
      for (; i < end; ++i) add(0, i);
      return std::accumulate(sums.begin(), sums.end(), 0.0);
    });
  };
  const auto count = static_cast<double>(us.counting());
  if (count == 0.0) return {};
  const double mean = sum_of([](double value) { return value; }) / count;
  const double squares = sum_of([&](double value) { return (value - mean) * (value - mean); });
  return {mean, std::sqrt(squares / count)};
}

/// The samples of one line; values that do not count are 0.
struct SampleLine {
  float* values;
  const std::uint8_t* reasons;
  std::size_t count;

  /// Replaces values by function(value, sample) where they count.
  template <typename Function>
  void replace(const Function& function) const {
    for (std::size_t s = 0; s < count; ++s) {
      const float replaced = function(values[s], s);
      values[s] = reasons[s] == 0 ? replaced : 0.0F;
    }
  }
};

SampleLine line_of(const BeamGrid& beams, ConditionedUltrasound& us, int frame, int line) {
  const std::size_t start = beams.offset(frame, line);
  return {us.samples.data() + start, us.reasons.data() + start,
          static_cast<std::size_t>(beams.samples())};
}

/// Arrays of which Gaussian sums are taken: 1 where a sample counts, its value, and its square.
enum Summed : std::size_t { kWeight, kValue, kSquare };

/// Calls use(line, sums) with the Gaussian sums of the first `arrays` of Summed.
template <typename UseLine>
void with_local_sums(const BeamGrid& beams, double sigma_mm, std::size_t arrays,
                     ConditionedUltrasound& us, const UseLine& use) {
  const auto fill = [&](int frame, int line, float* const* rows) {
    const SampleLine from = line_of(beams, us, frame, line);
    for (std::size_t s = 0; s < from.count; ++s)
      rows[kWeight][s] = from.reasons[s] == 0 ? 1.0F : 0.0F;
    std::copy_n(from.values, from.count, rows[kValue]);
    if (arrays > kSquare)
      for (std::size_t s = 0; s < from.count; ++s)
        rows[kSquare][s] = from.values[s] * from.values[s];
  };
  GaussianSums(beams, sigma_mm)(arrays, fill, [&](int frame, int line, const float* const* sums) {
    use(line_of(beams, us, frame, line), sums);
  });
}

void smooth(const BeamGrid& beams, double sigma_mm, ConditionedUltrasound& us) {
  if (sigma_mm == 0.0) return;
  with_local_sums(
      beams, sigma_mm, kSquare, us, [](const SampleLine& line, const float* const* sums) {
        line.replace([&](float, std::size_t s) { return sums[kValue][s] / sums[kWeight][s]; });
      });
}

void normalise(const BeamGrid& beams, const ConditioningOptions& options,
               ConditionedUltrasound& us) {
  if (options.normalisation == Normalisation::kFlatten) {
    with_local_sums(beams, options.window_mm, kSquare, us,
                    [](const SampleLine& line, const float* const* sums) {
                      line.replace([&](float value, std::size_t s) {
                        return value - sums[kValue][s] / sums[kWeight][s];
                      });
                    });
    return;
  }
  const auto least = static_cast<float>(options.least_deviation * options.least_deviation);
  with_local_sums(
      beams, options.window_mm, kSquare + 1, us,
      [&](const SampleLine& line, const float* const* sums) {
        std::vector<float> mean(line.count);
        std::vector<float> deviation(line.count);
        for (std::size_t s = 0; s < line.count; ++s) {
          mean[s] = sums[kValue][s] / sums[kWeight][s];
          const float mean_square = sums[kSquare][s] / sums[kWeight][s];
          deviation[s] = std::max(0.0F, mean_square - mean[s] * mean[s]) + least;
        }
        take_square_roots(deviation.data(), line.count);
        line.replace([&](float value, std::size_t s) { return (value - mean[s]) / deviation[s]; });
      });
}

}  // namespace

std::string to_string(ExclusionReason reason) {
  switch (reason) {
    case kUnknown:
      return "unknown";
    case kOutsideDepth:
      return "outside the depths of interest";
    case kFarWall:
      return "far wall";
    case kNoContact:
      return "no contact";
    case kSaturated:
      return "saturated";
    case kShadow:
      return "shadow";
    case kConstant:
      return "constant";
  }
  return "unnamed";
}

std::size_t ConditionedUltrasound::counting() const {
  return static_cast<std::size_t>(
      std::count(reasons.begin(), reasons.end(), static_cast<std::uint8_t>(0)));
}

void ConditioningOptions::validate(const std::string& source) const {
  const auto share = [&](const char* field, double value) {
    require(value >= 0.0 && value < 1.0, source, field, value, "within [0, 1)");
  };
  require_not_negative(source, "smoothing_mm", smoothing_mm);
  require_positive(source, "window_mm", window_mm);
  require_positive(source, "least_deviation", least_deviation);
  if (depth.min_mm) require_not_negative(source, "depth.min_mm", *depth.min_mm);
  if (depth.max_mm) require_not_negative(source, "depth.max_mm", *depth.max_mm);
  if (depth.min_mm && depth.max_mm)
    require(*depth.min_mm < *depth.max_mm, source, "depth.min_mm", *depth.min_mm, "< depth.max_mm");
  require_not_negative(source, "depth.near_field_mm", depth.near_field_mm);
  require_not_negative(source, "depth.near_field_limit_mm", depth.near_field_limit_mm);
  if (depth.far_wall_share)
    require(*depth.far_wall_share > 0.0 && *depth.far_wall_share <= 1.0, source,
            "depth.far_wall_share", *depth.far_wall_share, "within (0, 1]");
  require_not_negative(source, "depth.far_wall_margin_mm", depth.far_wall_margin_mm);
  if (saturated_grey)
    require(*saturated_grey > 0.0, source, "saturated_grey", *saturated_grey, "> 0");
  share("no_contact_share", no_contact_share);
  share("shadow_share", shadow_share);
  require_not_negative(source, "visible_grey", visible_grey);
  require_not_negative(source, "min_shadow_mm", min_shadow_mm);
}

ConditionedUltrasound condition(const BeamUltrasound& ultrasound,
                                const ConditioningOptions& options, const Progress& progress) {
  const auto report = [&](double fraction) {
    if (progress) progress(fraction);
  };
  ultrasound.validate();
  options.validate();
  ConditionedUltrasound result;
  result.lines = ultrasound.beams.lines;
  result.frames = ultrasound.beams.frames;
  exclude(ultrasound, options, result);
  report(0.2);
  result.samples = ultrasound.brightness;
  const bool in_deviations = options.normalisation != Normalisation::kNone;
  const Statistics all = statistics(result);
  if (all.deviation <= kConstantShare * std::abs(all.mean))
    for (std::uint8_t& reasons : result.reasons)
      if (reasons == 0) reasons = kConstant;
  parallel_for(result.frames, [&](int frame) {
    for (int line = 0; line < result.lines; ++line)
      line_of(ultrasound.beams, result, frame, line).replace([&](float value, std::size_t) {
        return in_deviations ? static_cast<float>((value - all.mean) / all.deviation) : value;
      });
  });
  smooth(ultrasound.beams, options.smoothing_mm, result);
  report(0.4);
  if (in_deviations) normalise(ultrasound.beams, options, result);
  report(1.0);
  return result;
}

}  // namespace usct
