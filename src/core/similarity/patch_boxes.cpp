#include "similarity/patch_boxes.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "parallel.h"
#include "ultrasound/moving_place.h"

namespace usct {
namespace {

using Eigen::Vector3i;

/// Ultrasound of a smaller deviation (in units of that of all ultrasound) counts as constant.
constexpr double kLeastDeviation = 1e-4;

/// Samples, lines and frames along each edge of a patch.
Vector3i patch_size(const BeamGrid& beams, const PatchOptions& options) {
  const double middle = 0.5 * (beams.samples() - 1);
  const auto steps = [](double edge_mm, double step_mm, int available) {
    if (!(step_mm > 0.0)) return available;
    return static_cast<int>(std::clamp(std::round(edge_mm / step_mm), 1.0, double(available)));
  };
  const auto distance = [&](int f_a, int l_a, int f_b, int l_b, double sample) {
    return (beams.point(f_a, l_a, sample) - beams.point(f_b, l_b, sample)).norm();
  };
  const int f = beams.frames / 2;
  double line_mm = 0.0;
  for (int i = 1; i < beams.lines; ++i)
    line_mm += distance(f, i - 1, f, i, middle) / (beams.lines - 1);
  const auto [l, sample] = moving_place(beams);
  double frame_mm = 0.0;
  for (int i = 1; i < beams.frames; ++i)
    frame_mm += distance(i - 1, l, i, l, sample) / (beams.frames - 1);
  return {steps(options.depth_mm, beams.axial.spacing_mm, beams.samples()),
          steps(options.lateral_mm, line_mm, beams.lines),
          steps(options.elevation_mm, frame_mm, beams.frames)};
}

/// Step between the samples of a line that count.
int step_of(SampleSubset samples) {
  switch (samples) {
    case SampleSubset::kAll:
      return 1;
    case SampleSubset::kHalf:
      return 2;
    case SampleSubset::kQuarter:
      return 4;
  }
  return 1;
}

/// Sums over the samples of a box. Brightness is summed as the difference from that of one of them:
/// squares of large numbers would hide small deviations, and a constant box has none at all.
struct BoxSums {
  double brightness = 0.0;
  double square = 0.0;
  double sample = 0.0;
  float from = 0.0F;
  std::size_t count = 0;
  int in_subset = 0;  // known or not

  void add(const int* samples, std::size_t number, const float* of_beam) {
    if (number == 0) return;
    if (count == 0) from = of_beam[samples[0]];
    count += number;
    for (std::size_t i = 0; i < number; ++i) {
      const int s = samples[i];
      const double difference = static_cast<double>(of_beam[s]) - static_cast<double>(from);
      brightness += difference;
      square += difference * difference;
      sample += s;
    }
  }
};

/// The statistics of a box; no samples if they are too few.
UltrasoundPatches::Patch patch_of(const PatchBox& box, const BoxSums& sums, const BeamGrid& beams,
                                  double least_share) {
  UltrasoundPatches::Patch patch;
  const auto count = static_cast<double>(sums.count);
  if (sums.count < 2 || count < least_share * sums.in_subset) return patch;
  patch.count = sums.count;
  patch.mean = static_cast<double>(sums.from) + sums.brightness / count;
  patch.square_sum = std::max(0.0, sums.square - sums.brightness * sums.brightness / count);
  patch.depth_mm = beams.axial.depth_mm(sums.sample / count);
  const Vector3i middle = (box.begin + box.end) / 2;
  patch.centre_us_mm = beams.point(middle.z(), middle.y(), middle.x());
  return patch;
}

/// Adds those of the boxes that lie behind each other on the same beams that become patches.
void add_chosen(std::vector<PatchBox>& column, const CountingSamples& counting,
                const BeamGrid& beams, double least_share, std::vector<PatchBox>& chosen) {
  std::vector<BoxSums> sums(column.size());
  std::vector<int> samples = counting.none();
  counting.for_beams(column.front(), [&](std::size_t beam, int line_and_frame) {
    for (std::size_t i = 0; i < column.size(); ++i) {
      const std::size_t count = counting.find(column[i], beam, line_and_frame, samples);
      sums[i].in_subset += counting.in_subset(column[i], line_and_frame);
      sums[i].add(samples.data(), count, counting.brightness(beam));
    }
  });
  for (std::size_t i = 0; i < column.size(); ++i)
    column[i].patch = patch_of(column[i], sums[i], beams, least_share);
  std::copy_if(column.begin(), column.end(), std::back_inserter(chosen), [](const PatchBox& box) {
    return box.patch.square_sum >
           kLeastDeviation * kLeastDeviation * static_cast<double>(box.patch.count);
  });
}

}  // namespace

CountingSamples::CountingSamples(const BeamUltrasound& ultrasound, SampleSubset subset)
    : us_(ultrasound), step_(step_of(subset)) {}

std::vector<PatchBox> choose_boxes(const BeamUltrasound& ultrasound, const PatchOptions& options) {
  const Vector3i all(ultrasound.beams.samples(), ultrasound.beams.lines, ultrasound.beams.frames);
  const Vector3i size = patch_size(ultrasound.beams, options);
  const CountingSamples counting(ultrasound, options.samples);
  const int layers = (all.z() + size.z() - 1) / size.z();
  std::vector<std::vector<PatchBox>> chosen(static_cast<std::size_t>(layers));
  parallel_for(layers, [&](int layer) {
    const int f = layer * size.z();
    std::vector<PatchBox> column;
    for (int l = 0; l < all.y(); l += size.y()) {
      column.clear();
      for (int s = 0; s < all.x(); s += size.x()) {
        const Vector3i begin(s, l, f);
        column.push_back({begin, (begin + size).cwiseMin(all), {}});
      }
      add_chosen(column, counting, ultrasound.beams, options.least_share,
                 chosen[static_cast<std::size_t>(layer)]);
    }
  });
  std::vector<PatchBox> boxes;
  for (const std::vector<PatchBox>& of_layer : chosen)
    boxes.insert(boxes.end(), of_layer.begin(), of_layer.end());
  std::stable_sort(boxes.begin(), boxes.end(), [](const PatchBox& a, const PatchBox& b) {
    return a.patch.count > b.patch.count;
  });
  return boxes;
}

}  // namespace usct
