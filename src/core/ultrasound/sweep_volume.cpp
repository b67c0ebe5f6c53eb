#include "ultrasound/sweep_volume.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "ultrasound/nanoseconds.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct {
namespace {

using Frames = std::vector<std::shared_ptr<const StreamedFrame>>;
using Eigen::Isometry3d;

constexpr const char* kRepeatedImage = "repeated image";
/// A motor that moves by less than this share of the mean step between frames is at rest.
constexpr double kRestingStep = 0.05;
/// The travel within a frame may differ by this share of the mean step over a sweep.
constexpr double kTravelTolerance = 0.25;

/// The frames of a sweep that are kept, with the data for the motion of the volume.
struct Kept {
  Frames frames;
  std::vector<Isometry3d> T_us_frame;  // tracked
  double travel_rad = 0.0;             // motorised
};

void require_rising_stamps(const Frames& frames, const std::string& source) {
  for (std::size_t i = 1; i < frames.size(); ++i)
    if (frames[i]->stamp_ns < frames[i - 1]->stamp_ns)
      throw InputError(source, "frame " + std::to_string(frames[i]->index) +
                                   " is stamped before the frame with the index below: frames must "
                                   "be counted in the order of their acquisition");
}

bool is_blank(const std::vector<std::uint8_t>& image) {
  return std::all_of(image.begin(), image.end(),
                     [&](std::uint8_t v) { return v == image.front(); });
}

bool repeats_image(const Frames& frames, std::size_t i) {
  return i > 0 && *frames[i]->brightness == *frames[i - 1]->brightness &&
         !is_blank(*frames[i]->brightness);
}

/// A volume has one travel for all of its frames: the median.
double common_travel_rad(const Frames& frames, double mean_step_rad, const std::string& source) {
  std::vector<double> travels;
  for (const auto& frame : frames) travels.push_back(frame->motor->travel_rad);
  std::sort(travels.begin(), travels.end());
  if (travels.back() - travels.front() > kTravelTolerance * mean_step_rad)
    throw InputError(source, "'motor_travel' changes from " + std::to_string(travels.front()) +
                                 " to " + std::to_string(travels.back()) +
                                 " rad, must be the same within a sweep");
  return travels[travels.size() / 2];
}

Kept keep_motorised(const Frames& frames, const std::string& source, Counts& dropped) {
  Kept kept;
  const auto angle = [](const auto& frame) { return frame->motor->angle_rad; };
  const double way = angle(frames.back()) - angle(frames.front());
  const double mean_step = std::abs(way) / static_cast<double>(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const double step = kept.frames.empty() ? std::numeric_limits<double>::infinity()
                                            : (way < 0.0 ? -1.0 : 1.0) *
                                                  (angle(frames[i]) - angle(kept.frames.back()));
    if (step < -kRestingStep * mean_step)
      throw InputError(source, "the motor turns back at frame " + std::to_string(frames[i]->index) +
                                   ", by " + std::to_string(-step) +
                                   " rad: each direction must be a sweep of its own");
    if (step <= kRestingStep * mean_step)
      ++dropped["motor at rest"];
    else if (repeats_image(frames, i))
      ++dropped[kRepeatedImage];
    else
      kept.frames.push_back(frames[i]);
  }
  kept.travel_rad = common_travel_rad(kept.frames, mean_step, source);
  return kept;
}

std::vector<double> times_s(const Frames& frames) {
  std::vector<double> times;
  for (const auto& frame : frames)
    times.push_back(seconds_from(frame->stamp_ns - frames.front()->stamp_ns));
  return times;
}

/// The pose of each frame at its stamp minus the lag; none beyond the poses of the sweep.
std::vector<std::optional<Isometry3d>> poses_shown(const Frames& frames, double image_lag_s,
                                                   const std::string& source) {
  TrackedSweep track;
  for (const auto& frame : frames) track.T_us_frame.push_back(frame->pose->T_us_frame);
  if (image_lag_s == 0.0 || !frames.front()->pose->at_stamp)
    return {track.T_us_frame.begin(), track.T_us_frame.end()};
  track.frame_times_s = times_s(frames);
  const LagCorrected corrected = correct_image_lag(track, image_lag_s, source);
  std::vector<std::optional<Isometry3d>> poses(frames.size());
  for (std::size_t k = 0; k < corrected.frames.size(); ++k)
    poses[static_cast<std::size_t>(corrected.frames[k])] = corrected.sweep.T_us_frame[k];
  return poses;
}

Kept keep_tracked(const Frames& all, double image_lag_s, const std::string& source,
                  Counts& dropped) {
  Kept kept;
  Frames frames;
  std::copy_if(all.begin(), all.end(), std::back_inserter(frames),
               [](const auto& frame) { return frame->pose.has_value(); });
  if (frames.empty()) throw InputError(source, "no frame has a pose");
  const auto poses = poses_shown(frames, image_lag_s, source);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!poses[i]) {
      ++dropped["no pose at the stamp minus image_lag"];
    } else if (repeats_image(frames, i)) {
      ++dropped[kRepeatedImage];
    } else {
      kept.frames.push_back(frames[i]);
      kept.T_us_frame.push_back(*poses[i]);
    }
  }
  if (kept.frames.empty()) throw InputError(source, "no image changes while a pose is known");
  return kept;
}

AssembledSweep assembled(const Kept& kept, double image_lag_s, const std::string& source) {
  AssembledSweep sweep;
  sweep.frames = kept.frames;
  const StreamedFrame& first = *kept.frames.front();
  sweep.us_frame_id = first.is_motorised() ? first.frame_id : first.pose->us_frame_id;
  for (const auto& frame : kept.frames)
    sweep.stamps_ns.push_back(frame->stamp_ns - nanoseconds_from(image_lag_s));
  PreScanVolume& volume = sweep.volume;
  volume.geometry.axial = first.axial;
  volume.geometry.array = first.array;
  if (first.is_motorised()) {
    MotorSweep motor{first.motor->motor_radius_mm, {}, kept.travel_rad};
    for (const auto& frame : kept.frames) motor.frame_angles_rad.push_back(frame->motor->angle_rad);
    volume.geometry.motion = std::move(motor);
  } else {
    volume.geometry.motion = TrackedSweep{kept.T_us_frame, times_s(kept.frames)};
  }
  volume.voxels.reserve(kept.frames.size() * first.brightness->size());
  for (const auto& frame : kept.frames)
    volume.voxels.insert(volume.voxels.end(), frame->brightness->begin(), frame->brightness->end());
  volume.validate(source);
  return sweep;
}

}  // namespace

AssembledSweep volume_of_sweep(const Frames& frames, double image_lag_s, const std::string& source,
                               Counts& dropped) {
  require_rising_stamps(frames, source);
  Counts left_out;
  const Kept kept = frames.front()->is_motorised()
                        ? keep_motorised(frames, source, left_out)
                        : keep_tracked(frames, image_lag_s, source, left_out);
  dropped.insert(left_out.begin(), left_out.end());
  return assembled(kept, image_lag_s, source);
}

}  // namespace usct
