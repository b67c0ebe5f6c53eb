// Conversion of a tracked sequence to ultrasound with poses in the US frame, and back.
#include "io/ultrasound/igsio_ultrasound.h"

#include <algorithm>
#include <set>

#include "io/description.h"
#include "io/ultrasound/option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

namespace usct {
namespace {

using Source = UltrasoundSource;

/// Poses in text files have about six digits.
constexpr double kRigidTolerance = 1e-3;

/// Options that place the beams of a probe in B-mode images.
const std::vector<UltrasoundField> kImageOptions = {&Source::image_origin_px,
                                                    &Source::image_spacing_mm, &Source::samples};
/// Options with which B-mode images are resampled along the beams.
const std::vector<UltrasoundField> kResamplingOptions = {
    &Source::probe, &Source::image_origin_px, &Source::image_spacing_mm, &Source::samples};

bool any_given(const UltrasoundSource& source, const std::vector<UltrasoundField>& options) {
  return std::any_of(options.begin(), options.end(),
                     [&](const UltrasoundField& option) { return io::is_given(source, option); });
}

/// The frames of a sequence that have a valid image and pose, and those poses.
struct ValidFrames {
  std::vector<int> frames;
  std::vector<Eigen::Affine3d> T_us_from;
  std::vector<double> times_s;  // empty unless every frame has one
};

/// The transforms of the frames that are not the same in all of them: what a tracker has seen.
std::set<std::string> tracked_names(const IgsioSequence& sequence) {
  std::set<std::string> tracked;
  IgsioTransforms first;
  for (const IgsioFrame& frame : sequence.frames)
    for (const auto& [name, transform] : frame.transforms) {
      if (!transform.valid()) continue;
      const auto& before = first.try_emplace(name, transform).first->second;
      if (before.T.matrix() != transform.T.matrix()) tracked.insert(name);
    }
  return tracked;
}

/// A transform of the calibration that stands for tracked ones, or a chain of calibrations alone,
/// would put all frames into one place.
void require_tracked_poses(const IgsioSequence& sequence, const UltrasoundSource& source,
                           const IgsioTransforms& calibration, const std::string& from) {
  const std::set<std::string> tracked = tracked_names(sequence);
  if (tracked.empty()) return;
  const std::string file = source.calibration.string();
  for (const std::string& one : tracked)
    if (takes_place_of(calibration, one))
      throw InputError(file, "its transforms would replace '" + one + "' of '" +
                                 source.path.string() + "', which changes from frame to frame");
  if (from != source.to && is_connected(calibration, from, source.to))
    throw InputError(file, "its transforms alone lead from '" + from + "' to '" + source.to +
                               "', so that all frames of '" + source.path.string() +
                               "' would lie in one place; leave out those that are tracked");
}

ValidFrames valid_frames(const IgsioSequence& sequence, const UltrasoundSource& source,
                         const std::string& from, std::vector<std::string>& warnings) {
  const IgsioTransforms calibration =
      source.calibration.empty() ? IgsioTransforms{} : read_plus_calibration(source.calibration);
  require_tracked_poses(sequence, source, calibration, from);
  ValidFrames valid;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const IgsioFrame& frame = sequence.frames[i];
    const std::string name = source.path.string() + " frame " + std::to_string(i);
    try {
      if (!frame.image_status.empty() && frame.image_status != "OK")
        throw InputError(name, "its image is marked '" + frame.image_status + "'");
      valid.T_us_from.push_back(transform_chain(frame, calibration, from, source.to, name));
    } catch (const InputError& error) {
      if (!source.skip_invalid_frames) throw;
      warnings.push_back(std::string("left out ") + error.what());
      continue;
    }
    valid.frames.push_back(static_cast<int>(i));
    if (frame.timestamp_s) valid.times_s.push_back(*frame.timestamp_s);
  }
  if (valid.frames.empty()) throw InputError(source.path.string(), "has no valid frame");
  if (valid.times_s.size() != valid.frames.size()) valid.times_s.clear();
  return valid;
}

TrackedSweep rigid_sweep(const ValidFrames& valid, const std::string& source) {
  TrackedSweep sweep;
  sweep.frame_times_s = valid.times_s;
  for (const Eigen::Affine3d& T : valid.T_us_from) {
    const Eigen::Matrix3d rotation = T.rotation();
    const double deviation = (T.linear() - rotation).cwiseAbs().maxCoeff();
    if (!(deviation < kRigidTolerance))
      throw InputError(source, "a frame's pose deviates from a rotation by " +
                                   std::to_string(deviation) + ", must be below 0.001");
    Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
    rigid.linear() = rotation;
    rigid.translation() = T.translation();
    sweep.T_us_frame.push_back(rigid);
  }
  return sweep;
}

bool is_before_scan_conversion(const IgsioSequence& sequence) {
  // The first letter is the fastest axis: along the line (far or near), or across it.
  return !sequence.orientation.empty() &&
         (sequence.orientation[0] == 'F' || sequence.orientation[0] == 'N');
}

IgsioSequence only_frames(IgsioSequence sequence, const std::vector<int>& frames) {
  if (frames.size() == sequence.frames.size()) return sequence;
  IgsioSequence kept = sequence;
  kept.frames.clear();
  kept.data.clear();
  const std::size_t bytes = sequence.frame_bytes();
  for (const int frame : frames) {
    const auto begin = sequence.data.begin() +
                       static_cast<std::ptrdiff_t>(bytes * static_cast<std::size_t>(frame));
    kept.frames.push_back(sequence.frames[static_cast<std::size_t>(frame)]);
    kept.data.insert(kept.data.end(), begin, begin + static_cast<std::ptrdiff_t>(bytes));
  }
  return kept;
}

TrackedImages tracked_images(const IgsioSequence& sequence, const ValidFrames& valid,
                             const std::string& source) {
  TrackedImages images;
  images.T_us_pixel = valid.T_us_from;
  images.times_s = valid.times_s;
  for (const int frame : valid.frames) {
    const OrientedImage image = oriented_frame(sequence, frame, "MF", source);
    images.width = image.width;
    images.height = image.height;
    images.pixels.insert(images.pixels.end(), image.pixels.begin(), image.pixels.end());
  }
  images.validate(source);
  return images;
}

/// The images resampled along the beams of the probe.
PreScanVolume along_beams(const TrackedImages& images, const UltrasoundSource& source) {
  const std::string name = source.path.string();
  const ProbeConfig probe = read_probe_config(source.probe);
  RecordedFrames recorded;
  recorded.samples = source.samples;
  recorded.lines = line_count(probe.array);
  recorded.frames = images.count();
  // Only the sampling along the lines comes from this geometry; the poses are those of the images.
  TrackedSweep poses;
  poses.T_us_frame.assign(images.T_us_pixel.size(), Eigen::Isometry3d::Identity());
  const AxialSampling axial = tracked_geometry(probe, recorded, poses, name).axial;
  const ImagePlacement placement{*source.image_origin_px, *source.image_spacing_mm};
  try {
    PreScanVolume volume = prescan_from_images(images, probe.array, axial, placement);
    std::get<TrackedSweep>(volume.geometry.motion).frame_times_s = images.times_s;
    return volume;
  } catch (const InputError& error) {  // it knows no file
    throw InputError(name, error.source() + " " + error.violation());
  }
}

std::vector<std::int16_t> int16_values(const std::vector<std::uint8_t>& little_endian) {
  std::vector<std::int16_t> values(little_endian.size() / 2);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<std::int16_t>(little_endian[2 * i] | little_endian[2 * i + 1] << 8);
  return values;
}

/// Adds the times and, for each name of a transform, the number of frames with a valid one.
void describe_frames(const std::vector<IgsioFrame>& frames, io::Json& json) {
  std::map<std::string, int> valid;
  int invalid_images = 0;
  int with_time = 0;
  for (const IgsioFrame& frame : frames) {
    if (frame.image_status != "OK") ++invalid_images;
    if (frame.timestamp_s) ++with_time;
    for (const auto& [name, transform] : frame.transforms) valid[name] += transform.valid() ? 1 : 0;
  }
  json["frames_with_time"] = with_time;
  if (with_time > 1 && frames.front().timestamp_s && frames.back().timestamp_s)
    json["duration_s"] = *frames.back().timestamp_s - *frames.front().timestamp_s;
  json["valid_transforms"] = valid;
  json["warnings"] = io::Json::array();
  if (invalid_images > 0)
    json["warnings"].push_back(std::to_string(invalid_images) + " images are not marked OK");
}

}  // namespace

UltrasoundInput read_igsio_ultrasound(const UltrasoundSource& source) {
  const IgsioSequence sequence = read_igsio(source.path);
  const bool beams = is_before_scan_conversion(sequence);
  const bool resampled = !beams && any_given(source, kResamplingOptions);
  if (beams) {
    io::refuse_options(source, kImageOptions,
                       "its frames are lines of samples before scan conversion, not images");
    io::require_options(source, {&Source::probe}, "the file does not hold the probe's geometry");
  } else if (resampled) {
    io::require_options(source, kResamplingOptions,
                        "without this its images cannot be resampled along the beams of a probe");
  }
  const std::string name = source.path.string();
  const std::string from = !source.from.empty() ? source.from : beams ? "Probe" : "Image";
  UltrasoundInput input;
  const ValidFrames valid = valid_frames(sequence, source, from, input.warnings);
  if (beams)
    input.data = to_prescan(only_frames(sequence, valid.frames), read_probe_config(source.probe),
                            rigid_sweep(valid, name), name);
  else if (resampled)
    input.data = along_beams(tracked_images(sequence, valid, name), source);
  else
    input.data = tracked_images(sequence, valid, name);
  return input;
}

void write_igsio_beams(const PreScanVolume& volume, const std::filesystem::path& path) {
  const auto* sweep = std::get_if<TrackedSweep>(&volume.geometry.motion);
  if (!sweep)
    throw InputError(path.string(), "a sequence holds tracked sweeps, not motorised ones");
  IgsioSequence sequence;
  sequence.width = volume.geometry.samples();
  sequence.height = volume.geometry.lines();
  sequence.orientation = "FM";
  sequence.image_type = "BRIGHTNESS";
  sequence.data = volume.voxels;
  for (std::size_t i = 0; i < sweep->T_us_frame.size(); ++i) {
    IgsioFrame frame;
    frame.image_status = "OK";
    if (!sweep->frame_times_s.empty()) frame.timestamp_s = sweep->frame_times_s[i];
    frame.transforms["ProbeToReference"] = {Eigen::Affine3d(sweep->T_us_frame[i].matrix()), "OK"};
    sequence.frames.push_back(frame);
  }
  write_igsio(sequence, path, true);
}

std::string describe_igsio(const std::filesystem::path& path) {
  const IgsioSequence sequence = read_igsio(path);
  io::Json json;
  json["image_type"] = sequence.image_type;
  json["orientation"] = sequence.orientation;
  json["width_height_frames"] = {sequence.width, sequence.height, sequence.frames.size()};
  describe_frames(sequence.frames, json);
  if (sequence.element == IgsioElement::kUint8)
    io::describe_range(sequence.data, json);
  else
    io::describe_range(int16_values(sequence.data), json);
  return io::as_text(json);
}

}  // namespace usct
