#include "us_ct_registration/ultrasound/conditioning.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "require.h"
#include "ultrasound/exclusion.h"
#include "ultrasound/gaussian_sums.h"

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

Statistics statistics(const std::vector<float>& values, const std::vector<std::uint8_t>& reasons) {
  const auto sum_of = [&](const auto& term) {
    return parallel_sum(values.size(), [&](std::size_t begin, std::size_t end) {
      double sum = 0.0;
      for (std::size_t i = begin; i < end; ++i)
        if (reasons[i] == 0) sum += term(values[i]);
      return sum;
    });
  };
  const auto count = static_cast<double>(std::count(reasons.begin(), reasons.end(), 0));
  if (count == 0.0) return {};
  const double mean = sum_of([](float value) { return value; }) / count;
  const double squares = sum_of([&](float value) { return (value - mean) * (value - mean); });
  return {mean, std::sqrt(squares / count)};
}

/// Returns function(value, i) where a sample counts, and 0 elsewhere.
template <typename Function>
std::vector<float> where_counting(const ConditionedUltrasound& us, std::vector<float> values,
                                  const Function& function) {
  parallel_ranges(values.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      values[i] = us.reasons[i] == 0 ? function(values[i], i) : 0.0F;
  });
  return values;
}

std::vector<float> local_mean(const GaussianSums& sums, const ConditionedUltrasound& us,
                              std::vector<float> values, const std::vector<float>& weight) {
  return where_counting(us, sums(std::move(values)),
                        [&](float sum, std::size_t i) { return sum / weight[i]; });
}

std::vector<float> counting_mask(const ConditionedUltrasound& us) {
  return where_counting(us, std::vector<float>(us.reasons.size()),
                        [](float, std::size_t) { return 1.0F; });
}

void smooth(const BeamGrid& beams, double sigma_mm, ConditionedUltrasound& us) {
  if (sigma_mm == 0.0) return;
  const GaussianSums sums(beams, sigma_mm);
  us.samples = local_mean(sums, us, std::move(us.samples), sums(counting_mask(us)));
}

void normalise(const BeamGrid& beams, const ConditioningOptions& options,
               ConditionedUltrasound& us) {
  const GaussianSums sums(beams, options.window_mm);
  const std::vector<float> weight = sums(counting_mask(us));
  const std::vector<float> mean = local_mean(sums, us, us.samples, weight);
  if (options.normalisation == Normalisation::kFlatten) {
    us.samples = where_counting(us, std::move(us.samples),
                                [&](float value, std::size_t i) { return value - mean[i]; });
    return;
  }
  std::vector<float> squares =
      where_counting(us, us.samples, [](float value, std::size_t) { return value * value; });
  const std::vector<float> mean_square = local_mean(sums, us, std::move(squares), weight);
  const auto least = static_cast<float>(options.least_deviation * options.least_deviation);
  us.samples = where_counting(us, std::move(us.samples), [&](float value, std::size_t i) {
    const float variance = std::max(0.0F, mean_square[i] - mean[i] * mean[i]);
    return (value - mean[i]) / std::sqrt(variance + least);
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
  const Statistics all = statistics(result.samples, result.reasons);
  if (all.deviation <= kConstantShare * std::abs(all.mean))
    for (std::uint8_t& reasons : result.reasons)
      if (reasons == 0) reasons = kConstant;
  result.samples = where_counting(result, std::move(result.samples), [&](float value, std::size_t) {
    return in_deviations ? static_cast<float>((value - all.mean) / all.deviation) : value;
  });
  smooth(ultrasound.beams, options.smoothing_mm, result);
  report(0.4);
  if (in_deviations) normalise(ultrasound.beams, options, result);
  report(1.0);
  return result;
}

}  // namespace usct
