#include <cmath>

#include "ros/ingest/ingest_parameters.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"

namespace usct::ros_interface {
namespace {

/// Lists of whole numbers; as read, and empty if not set.
struct Sizes {
  std::vector<double> image;
  std::vector<double> crop;
};

std::vector<int> whole_numbers(const std::vector<double>& values, const std::string& name) {
  std::vector<int> whole;
  for (const double value : values) {
    constexpr double kMost = 100000.0;
    if (!(std::floor(value) == value && value >= 0.0 && value <= kMost))
      throw InputError(name, "has " + std::to_string(value) +
                                 ", must be whole numbers of pixels from 0 to 100000");
    whole.push_back(static_cast<int>(value));
  }
  return whole;
}

void require_set(bool is_set, const std::string& name, const std::string& what) {
  if (!is_set) throw InputError(name, "is not set, must be " + what + " (source is 'images')");
}

void take_sizes(const Sizes& sizes, ImageStreamOptions& images) {
  require_set(!sizes.image.empty(), "image_size", "the width and height of the images");
  const std::vector<int> size = whole_numbers(sizes.image, "image_size");
  images.width = size[0];
  images.height = size[1];
  if (images.width < 2 || images.height < 2)
    throw InputError("image_size", "is " + std::to_string(images.width) + " x " +
                                       std::to_string(images.height) + ", must be 2 x 2 or more");
  if (sizes.crop.empty()) return;
  const std::vector<int> crop = whole_numbers(sizes.crop, "crop");
  try {
    images.shown = shown_rectangle(images.width, images.height, crop[0], crop[1], crop[2], crop[3]);
  } catch (const InputError& error) {
    throw InputError("crop", error.violation());
  }
}

/// The beams of the probe, and where the images have them.
void take_probe(const UltrasoundSource& source, ImageStreamOptions& images) {
  require_set(!source.probe.empty(), "probe", "a probe YAML");
  require_set(source.image_origin_px.has_value(), "image_origin_px and image_spacing_mm",
              "the place of the probe in the images");
  require_set(source.samples > 0, "samples", "the number of samples per line");
  const ProbeConfig probe = read_probe_config(source.probe);
  RecordedFrames recorded;
  recorded.samples = source.samples;
  recorded.lines = line_count(probe.array);
  recorded.frames = 1;
  const TrackedSweep one{{Eigen::Isometry3d::Identity()}, {}};
  images.sweep.array = probe.array;
  images.sweep.axial = tracked_geometry(probe, recorded, one, source.probe.string()).axial;
  images.placement = {*source.image_origin_px, *source.image_spacing_mm};
  if (source.calibration.empty()) return;
  const std::string name = source.calibration.string();
  const Eigen::Affine3d T_image_pixel =
      transform_chain(IgsioFrame(), read_plus_calibration(source.calibration),
                      source.from.empty() ? "Image" : source.from, source.to, name);
  images.T_image_frame = array_pose(T_image_pixel, images.placement, name);
}

}  // namespace

ImageStreamOptions read_image_stream(Parameters& parameters, const FileOptions& file,
                                     const FrameStreamOptions& frames, bool used) {
  ImageStreamOptions images;
  ImageSweepOptions& sweep = images.sweep;
  const Sizes sizes{parameters.numbers("image_size", 2), parameters.numbers("crop", 4)};
  images.image_frame = parameters.frame("image_frame", "");
  images.by_service =
      parameters.choice("sweep_control", "service", {"service", "pause"}) == "service";
  images.transport = parameters.image_transport();
  images.longest_sweep_s = parameters.number("longest_sweep", 60.0, 1.0, 600.0);
  sweep.repeat_tolerance = parameters.number("repeat_tolerance", 0.5, 0.0, 50.0);
  sweep.correct_lag = parameters.flag("correct_lag", true);
  sweep.us_frame_id = frames.pose_frame;
  sweep.longest_pause_s = frames.assembly.sweep_pause_s;
  sweep.max_missing = frames.assembly.max_missing;
  sweep.max_frames = frames.assembly.max_frames;
  sweep.max_bytes = frames.assembly.max_bytes;
  sweep.image_lag_s = frames.assembly.image_lag_s;
  images.tf_wait_s = frames.tf_wait_s;
  images.max_tf_gap_s = frames.max_tf_gap_s;
  images.lag_tolerance_s = frames.lag_tolerance_s;
  if (!used) return images;
  require_set(!frames.pose_frame.empty(), "pose_frame", "the tf frame of the volumes");
  take_sizes(sizes, images);
  take_probe(file.ultrasound, images);
  return images;
}

}  // namespace usct::ros_interface
