#include "ultrasound/stray_frames.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>

#include "order_statistics.h"
#include "ultrasound/probe_path.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

constexpr int kBeside = 3;  // frames before and after one that it is compared with

/// The lower median distance of neighbours among the frames from `first` to `last` other than
/// `frame`, mm. The frames beside it may be stray as well.
double usual_step_mm(const BeamGrid& beams, int first, int last, int frame) {
  std::vector<double> steps;
  for (int f = first; f < last; ++f)
    if (f != frame && f + 1 != frame) steps.push_back(farthest_apart_mm(beams, f, f + 1));
  if (steps.empty()) return 0.0;
  return value_of_rank(steps, (steps.size() - 1) / 2);
}

bool is_stray(const BeamGrid& beams, int frame) {
  const int first = std::max(0, frame - kBeside);
  const int last = std::min(beams.frames - 1, frame + kBeside);
  const auto is_far = [&](int other, double allowed_mm) {
    return farthest_apart_mm(beams, frame, other) > allowed_mm;
  };
  // Most frames end here.
  bool any = false;
  for (int other = first; other <= last; ++other) any |= is_far(other, kStrayMm);
  if (!any) return false;
  // A probe that moves fast and turns back is as far from the frames before and after, at its usual
  // step.
  const double step_mm = usual_step_mm(beams, first, last, frame);
  const auto is_off_from = [&](int other) {
    return is_far(other, kStrayMm + std::abs(other - frame) * step_mm);
  };
  int far = 0;
  bool is_off = false;  // away from a path that comes back
  for (int before = first; before < frame; ++before) far += is_off_from(before) ? 1 : 0;
  for (int after = frame + 1; after <= last; ++after) {
    if (!is_off_from(after)) continue;
    ++far;
    for (int before = first; before < frame; ++before)
      is_off |= is_off_from(before) && farthest_apart_mm(beams, before, after) <= kStrayMm;
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

FramesOnPath frames_on_path(const BeamUltrasound& ultrasound) {
  ultrasound.validate();
  ultrasound.beams.validate();
  FramesOnPath frames{stray_frames(ultrasound.beams), std::nullopt};
  if (!frames.stray.empty()) frames.others = without_frames(ultrasound, frames.stray);
  require_no_jump(frames.others ? frames.others->beams : ultrasound.beams, "ultrasound",
                  frames.stray);
  return frames;
}

}  // namespace usct
