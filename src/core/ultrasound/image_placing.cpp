#include <algorithm>
#include <cmath>

#include "ultrasound/nanoseconds.h"
#include "ultrasound/probe_path.h"
#include "ultrasound/sweep_volume.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/ultrasound/image_sweep.h"

namespace usct {
namespace {

using Eigen::Vector3d;

/// A probe whose field of view does not leave its first place by more does not move: trackers have
/// such noise.
constexpr double kLeastReachMm = 1.0;
/// A scanner shows fewer images than a grabber captures, and the probe moves on while they are the
/// same. If it moves by more than this, the picture is frozen.
constexpr double kFrozenMm = 5.0;
/// Largest share of the probe's path with a frozen picture.
constexpr double kMostFrozenShare = 0.5;

/// The middle of the field of view where each image was acquired, in the US frame, and the image.
struct Seen {
  Vector3d p_mm;
  const std::vector<std::uint8_t>* brightness;
};

/// The probe's path, in mm, and the parts of it that no image shows.
struct Path {
  double reach_mm = 0.0;  // the farthest from its start
  double length_mm = 0.0;
  double frozen_mm = 0.0;  // with a picture that does not change
  double unseen_mm = 0.0;  // between images that lie far apart
};

/// At least one image was seen.
Path path_of(const std::vector<Seen>& all) {
  Path path;
  const Seen* before = &all.front();
  const Seen* first = &all.front();  // of the images that are the same
  double same_mm = 0.0;              // reach of the probe since then
  const auto end_same = [&] {
    if (same_mm > kFrozenMm) path.frozen_mm += same_mm;
    same_mm = 0.0;
  };
  for (const Seen& seen : all) {
    path.reach_mm = std::max(path.reach_mm, (seen.p_mm - all.front().p_mm).norm());
    const double away_mm = (seen.p_mm - first->p_mm).norm();
    if (seen.brightness == first->brightness) {
      same_mm = std::max(same_mm, away_mm);
    } else {
      const double step_mm = (seen.p_mm - before->p_mm).norm();
      if (step_mm > kHoleMm) path.unseen_mm += step_mm;
      end_same();
      path.length_mm += away_mm;
      first = &seen;
    }
    before = &seen;
  }
  path.length_mm += same_mm;
  end_same();
  return path;
}

std::string of_path(double part_mm, const Path& path) {
  return formatted("%.0f", part_mm) + " mm of the probe's path of " +
         formatted("%.0f", path.length_mm) + " mm";
}

/// Requires that the probe moves, and the images with it. Returns a warning about the parts of the
/// path that no image shows, or an empty text.
std::string require_change(const Path& path, const std::string& source) {
  if (path.reach_mm < kLeastReachMm)
    throw InputError(source, "the probe moves by " + formatted("%.2f", path.reach_mm) +
                                 " mm only, must move by 1 mm or more: it was held still, or tf "
                                 "does not follow it");
  std::string warning;
  if (path.frozen_mm > 0.0) {
    warning = "the images do not change over " + of_path(path.frozen_mm, path);
    if (path.frozen_mm > kMostFrozenShare * path.length_mm)
      throw InputError(source, warning + ": the picture is frozen, or the probe has no contact");
  }
  if (path.unseen_mm > 0.0)
    warning += (warning.empty() ? "" : "; ") +
               ("no image with a pose shows " + of_path(path.unseen_mm, path) + ": ") + kWhyHoles;
  return warning;
}

/// Places the images of one sweep.
class Placing {
 public:
  Placing(const ImageSweep& sweep, const ArrayPoseAt& pose_at)
      : sweep_(sweep), options_(sweep.options()), pose_at_(pose_at), name_(sweep.name()) {}

  PlacedSweep placed(const std::optional<LagEstimate>& known) {
    require_images();
    PlacedSweep result;
    look_up(options_.image_lag_s);
    result.lag = lag();
    choose_lag(known, result);
    if (result.corrected_lag_s != options_.image_lag_s) look_up(result.corrected_lag_s);
    require_poses();
    result.warning = require_change(path_of(path()), name_);
    result.dropped = dropped();
    result.assembled = volume_of_sweep(frames_, result.corrected_lag_s, name_, result.dropped);
    return result;
  }

 private:
  void require_images() const {
    if (sweep_.images().empty()) throw InputError(name_, "has no image");
    if (sweep_.distinct() < 2)
      throw InputError(name_, "its " + std::to_string(sweep_.images().size()) +
                                  " images are all the same: the picture is frozen, or the probe "
                                  "has no contact");
  }

  /// Makes the frames, with their poses at their stamps minus the lag.
  void look_up(double lag_s) {
    frames_.clear();
    without_pose_ = 0;
    for (const ImageSweep::Image& image : sweep_.images()) {
      auto frame = std::make_shared<StreamedFrame>();
      frame->sweep = sweep_.number();
      frame->index = static_cast<std::uint32_t>(frames_.size());
      frame->stamp_ns = image.stamp_ns;
      frame->axial = options_.axial;
      frame->array = options_.array;
      frame->brightness = image.brightness;
      const ArrayPoseThen then = pose_at_(image.stamp_ns - nanoseconds_from(lag_s));
      if (then.T_us_frame) {
        frame->pose = FramePose{*then.T_us_frame, options_.us_frame_id, false};
      } else {
        ++without_pose_;
        problem_ = then.problem;
      }
      frames_.push_back(frame);
    }
  }

  /// The lag by the images that have a pose.
  LagEstimate lag() const {
    PreScanVolume volume{{options_.axial, options_.array, TrackedSweep()}, {}, {}};
    auto& track = std::get<TrackedSweep>(volume.geometry.motion);
    for (const auto& frame : frames_) {
      if (!frame->pose) continue;
      track.T_us_frame.push_back(frame->pose->T_us_frame);
      track.frame_times_s.push_back(seconds_from(frame->stamp_ns - frames_.front()->stamp_ns));
      volume.voxels.insert(volume.voxels.end(), frame->brightness->begin(),
                           frame->brightness->end());
    }
    LagEstimate estimate;
    if (track.T_us_frame.empty()) {
      estimate.message = "no pose is known";
      return estimate;
    }
    estimate = estimate_lag(volume);
    estimate.lag_s += options_.image_lag_s;
    estimate.interval_s.first += options_.image_lag_s;
    estimate.interval_s.second += options_.image_lag_s;
    return estimate;
  }

  void choose_lag(const std::optional<LagEstimate>& known, PlacedSweep& result) const {
    result.corrected_lag_s = options_.image_lag_s;
    result.lag_source = "as image_lag says";
    if (!options_.correct_lag) return;
    const std::optional<LagEstimate> best = better_lag(known, result.lag);
    if (!best) return;
    result.corrected_lag_s = best->lag_s;
    const bool is_own = result.lag.determined && best->lag_s == result.lag.lag_s;
    result.lag_source = is_own ? "estimated from it" : "estimated from an earlier sweep";
  }

  Counts dropped() const {
    Counts counts;
    if (sweep_.same_stamp() > 0) counts["same stamp"] = sweep_.same_stamp();
    if (without_pose_ > 0) counts["without pose"] = without_pose_;
    return counts;
  }

  void require_poses() const {
    const auto count = static_cast<double>(frames_.size());
    if (static_cast<double>(without_pose_) <= options_.max_missing * count) return;
    throw InputError(name_, std::to_string(without_pose_) + " of " +
                                std::to_string(frames_.size()) + " images have no pose (" +
                                problem_ + "); max_missing is " +
                                std::to_string(options_.max_missing));
  }

  std::vector<Seen> path() const {
    const Vector3d middle_mm = middle_of_field_mm(options_.axial, options_.array);
    std::vector<Seen> path;
    for (const auto& frame : frames_)
      if (frame->pose)
        path.push_back({frame->pose->T_us_frame * middle_mm, frame->brightness.get()});
    return path;
  }

  const ImageSweep& sweep_;
  const ImageSweepOptions& options_;
  const ArrayPoseAt& pose_at_;
  const std::string name_;
  std::vector<std::shared_ptr<const StreamedFrame>> frames_;
  std::uint64_t without_pose_ = 0;
  std::string problem_;
};

}  // namespace

PlacedSweep place_images(const ImageSweep& sweep, const ArrayPoseAt& pose_at,
                         const std::optional<LagEstimate>& known) {
  return Placing(sweep, pose_at).placed(known);
}

}  // namespace usct
