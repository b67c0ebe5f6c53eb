#include "ultrasound/stray_frames.h"

#include <algorithm>
#include <cstddef>

#include "ultrasound/probe_path.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

constexpr int kBeside = 3;  // frames before and after one that it is compared with

bool is_far(const BeamGrid& beams, int frame, int other) {
  return farthest_apart_mm(beams, frame, other) > kStrayMm;
}

bool is_stray(const BeamGrid& beams, int frame) {
  const int first = std::max(0, frame - kBeside);
  const int last = std::min(beams.frames - 1, frame + kBeside);
  int far = 0;
  bool is_off = false;  // away from a path that comes back
  for (int before = first; before < frame; ++before) far += is_far(beams, frame, before) ? 1 : 0;
  for (int after = frame + 1; after <= last; ++after) {
    if (!is_far(beams, frame, after)) continue;
    ++far;
    for (int before = first; before < frame; ++before)
      is_off |= is_far(beams, frame, before) && !is_far(beams, before, after);
  }
  return is_off && 2 * far > last - first;
}

/// Appends the `size` elements of a frame, unless `from` is empty.
template <typename T>
void append_frame(const std::vector<T>& from, int frame, std::size_t size, std::vector<T>& to) {
  if (from.empty()) return;
  const auto begin = from.begin() + static_cast<std::ptrdiff_t>(frame * size);
  to.insert(to.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
}

}  // namespace

std::vector<int> stray_frames(const BeamGrid& beams) {
  std::vector<int> stray;
  if (!beams.tracked) return stray;
  for (int frame = 0; frame < beams.frames; ++frame)
    if (is_stray(beams, frame)) stray.push_back(frame);
  if (static_cast<double>(stray.size()) > kMostStrayShare * beams.frames) stray.clear();
  return stray;
}

std::string stray_words(const std::vector<int>& stray, int frames) {
  return "the tracker's poses of " + std::to_string(stray.size()) + " of " +
         std::to_string(frames) + " frames, frame " + std::to_string(stray.front()) +
         " first, lie more than " + formatted("%g", kStrayMm) + " mm off the probe's path";
}

BeamUltrasound without_frames(const BeamUltrasound& in, const std::vector<int>& frames) {
  const auto lines = static_cast<std::size_t>(in.beams.lines);
  const std::size_t samples = lines * static_cast<std::size_t>(in.beams.samples());
  BeamUltrasound out;
  out.beams = in.beams;
  out.beams.beams.clear();
  for (int frame = 0; frame < in.beams.frames; ++frame) {
    if (std::binary_search(frames.begin(), frames.end(), frame)) continue;
    append_frame(in.beams.beams, frame, lines, out.beams.beams);
    append_frame(in.brightness, frame, samples, out.brightness);
    append_frame(in.known, frame, samples, out.known);
  }
  out.beams.frames = in.beams.frames - static_cast<int>(frames.size());
  return out;
}

}  // namespace usct
