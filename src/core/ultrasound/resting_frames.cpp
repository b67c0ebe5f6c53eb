#include "ultrasound/resting_frames.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "parallel.h"
#include "ultrasound/probe_path.h"

namespace usct {
namespace {

/// The first frames of the groups, and the number of frames at the end.
std::vector<int> groups_of(const BeamGrid& beams) {
  std::vector<int> first{0};
  for (int frame = 1; frame < beams.frames; ++frame)
    if (farthest_apart_mm(beams, first.back(), frame) >= kRestMm) first.push_back(frame);
  first.push_back(beams.frames);
  return first;
}

/// The mean of a beam in the frames [begin, end).
Beam beam_of_group(const BeamGrid& beams, int begin, int end, int line) {
  Beam mean = beams.beam(begin, line);
  if (end - begin == 1) return mean;
  for (int frame = begin + 1; frame < end; ++frame) {
    mean.origin_mm += beams.beam(frame, line).origin_mm;
    mean.direction += beams.beam(frame, line).direction;
  }
  mean.origin_mm /= end - begin;
  mean.direction.normalize();
  return mean;
}

/// Writes the means of the samples in the frames [begin, end) to a frame of `out`.
void average_samples(const BeamUltrasound& in, int begin, int end, int frame, BeamUltrasound& out) {
  const auto per_frame =
      static_cast<std::size_t>(in.beams.lines) * static_cast<std::size_t>(in.beams.samples());
  const std::size_t to = static_cast<std::size_t>(frame) * per_frame;
  for (std::size_t i = 0; i < per_frame; ++i) {
    float sum = 0.0F;
    int count = 0;
    for (int f = begin; f < end; ++f) {
      const std::size_t from = static_cast<std::size_t>(f) * per_frame + i;
      if (!in.known.empty() && in.known[from] == 0) continue;
      sum += in.brightness[from];
      ++count;
    }
    const bool is_known = 2 * count >= end - begin;
    out.brightness[to + i] = is_known ? sum / static_cast<float>(count) : 0.0F;
    if (!in.known.empty()) out.known[to + i] = is_known ? 1 : 0;
  }
}

}  // namespace

std::optional<BeamUltrasound> without_resting_frames(const BeamUltrasound& in) {
  if (!in.beams.tracked) return std::nullopt;
  const std::vector<int> first = groups_of(in.beams);
  const int groups = static_cast<int>(first.size()) - 1;
  if (groups == in.beams.frames) return std::nullopt;
  BeamUltrasound out;
  out.beams = in.beams;
  out.beams.frames = groups;
  out.beams.beams.clear();
  const auto begin = [&](int group) { return first[static_cast<std::size_t>(group)]; };
  for (int group = 0; group < groups; ++group)
    for (int line = 0; line < in.beams.lines; ++line)
      out.beams.beams.push_back(beam_of_group(in.beams, begin(group), begin(group + 1), line));
  out.brightness.resize(out.beams.beams.size() * static_cast<std::size_t>(in.beams.samples()));
  if (!in.known.empty()) out.known.resize(out.brightness.size());
  parallel_for(groups,
               [&](int group) { average_samples(in, begin(group), begin(group + 1), group, out); });
  return out;
}

int moving_frames(const BeamGrid& beams) {
  if (!beams.tracked) return beams.frames;
  const std::vector<int> first = groups_of(beams);
  std::vector<int> sizes;
  for (std::size_t group = 1; group < first.size(); ++group)
    sizes.push_back(first[group] - first[group - 1]);
  const auto groups = static_cast<double>(sizes.size());
  std::sort(sizes.begin(), sizes.end());
  const int most = 2 * sizes[sizes.size() / 2];
  sizes.erase(std::upper_bound(sizes.begin(), sizes.end(), most), sizes.end());
  const double moving = std::accumulate(sizes.begin(), sizes.end(), 0.0);
  return static_cast<int>(std::lround(groups * moving / static_cast<double>(sizes.size())));
}

}  // namespace usct
