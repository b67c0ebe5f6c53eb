#include "registration/images/prepared_ultrasound.h"

#include <algorithm>

#include "ultrasound/decimation.h"

namespace usct::registration {
namespace {

using Eigen::Vector3d;

/// Approximate number of points that measure distances between poses; more would not change them.
constexpr std::size_t kPoints = 2000;

/// `known` must be 1 at the samples that count, and 0 elsewhere.
std::vector<Vector3d> counting_points(const BeamUltrasound& us) {
  const auto counting = static_cast<std::size_t>(std::count(us.known.begin(), us.known.end(), 1));
  const std::size_t step = std::max<std::size_t>(1, counting / kPoints);
  std::vector<Vector3d> points;
  const auto samples = static_cast<std::size_t>(us.beams.samples());
  std::size_t to_skip = 0;  // counted down, since a remainder takes far longer
  for (std::size_t beam = 0; beam < us.beams.beams.size(); ++beam) {
    const std::uint8_t* known = us.known.data() + beam * samples;
    const auto of_beam = static_cast<std::size_t>(std::count(known, known + samples, 1));
    if (of_beam <= to_skip) {
      to_skip -= of_beam;
      continue;
    }
    const Beam& from = us.beams.beams[beam];
    for (std::size_t s = 0; s < samples; ++s) {
      if (known[s] == 0) continue;
      if (to_skip == 0)
        points.push_back(from.origin_mm +
                         us.beams.axial.depth_mm(static_cast<double>(s)) * from.direction);
      to_skip = to_skip == 0 ? step - 1 : to_skip - 1;
    }
  }
  return points;
}

}  // namespace

std::optional<BeamUltrasound> averaged_to(const BeamUltrasound& us,
                                          const std::optional<double>& spacing_mm) {
  if (!spacing_mm) return std::nullopt;
  const Eigen::Vector3i factors = factors_for_spacing(us.beams, *spacing_mm);
  if (factors == Eigen::Vector3i::Ones()) return std::nullopt;
  return decimate(us, factors);
}

PreparedUltrasound prepare_ultrasound(const BeamUltrasound& ultrasound,
                                      const RegistrationOptions& options, const Check& check) {
  const std::optional<BeamUltrasound> coarse =
      averaged_to(ultrasound, options.conditioning_spacing_mm);
  const BeamUltrasound& input = coarse ? *coarse : ultrasound;
  ConditionedUltrasound conditioned = condition(input, options.conditioning, [&](double) {
    if (check) check();
  });
  auto us = std::make_shared<BeamUltrasound>();
  us->beams = input.beams;
  us->brightness = std::move(conditioned.samples);
  us->known = std::move(conditioned.reasons);
  for (std::uint8_t& known : us->known) known = known == 0 ? 1 : 0;
  FieldPoints field(counting_points(*us));
  return {std::move(us), std::move(field)};
}

}  // namespace usct::registration
