#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

#include <cmath>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/file_kind.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

/// Poses in text files have about six digits.
constexpr double kRigidTolerance = 1e-3;

ProbeConfig required_probe(const UltrasoundSource& source) {
  if (source.probe.empty())
    throw InputError(source.path.string(),
                     "says nothing of the probe's geometry: a probe YAML is needed");
  return read_probe_config(source.probe);
}

void refuse_probe(const UltrasoundSource& source, FileKind kind) {
  if (!source.probe.empty())
    throw InputError(source.probe.string(), "is a probe YAML for " + source.path.string() +
                                                ", but a " + file_kind_name(kind) +
                                                " holds its own geometry");
}

/// The frames of a sequence that have a valid image and pose, and those poses.
struct ValidFrames {
  std::vector<int> frames;
  std::vector<Eigen::Affine3d> T_us_from;
  std::vector<double> times_s;  // empty unless every frame has one
};

ValidFrames valid_frames(const IgsioSequence& sequence, const UltrasoundSource& source,
                         const std::string& from, std::vector<std::string>& warnings) {
  const IgsioTransforms calibration =
      source.calibration.empty() ? IgsioTransforms{} : read_plus_calibration(source.calibration);
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
  return images;
}

Ultrasound read_sequence(const UltrasoundSource& source, std::vector<std::string>& warnings) {
  const std::string name = source.path.string();
  const IgsioSequence sequence = read_igsio(source.path);
  const bool beams = is_before_scan_conversion(sequence);
  const std::string from = !source.from.empty() ? source.from : beams ? "Probe" : "Image";
  const ValidFrames valid = valid_frames(sequence, source, from, warnings);
  if (beams)
    return to_prescan(only_frames(sequence, valid.frames), required_probe(source),
                      rigid_sweep(valid, name), name);
  const TrackedImages images = tracked_images(sequence, valid, name);
  if (source.probe.empty()) return images;
  if (!source.placement || source.samples < 2)
    throw InputError(name,
                     "to resample its images along the beams of a probe, the place of the probe in "
                     "the image (origin in pixels, pixel size in mm) and the number of samples per "
                     "line (>= 2) are needed");
  const ProbeConfig probe = read_probe_config(source.probe);
  RecordedFrames recorded;
  recorded.samples = source.samples;
  recorded.lines = line_count(probe.array);
  recorded.frames = images.count();
  // Only the sampling along the lines is taken from this: the poses are those of the images.
  TrackedSweep poses;
  poses.T_us_frame.assign(valid.frames.size(), Eigen::Isometry3d::Identity());
  const AxialSampling axial = tracked_geometry(probe, recorded, poses, name).axial;
  PreScanVolume volume = prescan_from_images(images, probe.array, axial, *source.placement);
  std::get<TrackedSweep>(volume.geometry.motion).frame_times_s = valid.times_s;
  return volume;
}

PreScanVolume read_recording(const UltrasoundSource& source, FileKind kind) {
  const ProbeConfig probe = required_probe(source);
  const std::string name = source.path.string();
  if (kind == FileKind::kPropello)
    return to_prescan(read_propello(source.path), probe, source.sweep, source.first_backward, name);
  SweepSelection selection;
  selection.index = source.sweep;
  selection.frames_per_sweep = source.frames_per_sweep;
  selection.first_backward = source.first_backward;
  return to_prescan(read_ultrasonix(source.path), probe, selection, name);
}

}  // namespace

UltrasoundInput read_ultrasound(const UltrasoundSource& source) {
  UltrasoundInput input;
  const FileKind kind = detect_file_kind(source.path);
  switch (kind) {
    case FileKind::kPreScan:
      refuse_probe(source, kind);
      input.data = read_prescan_nrrd(source.path);
      break;
    case FileKind::kVolume:
      refuse_probe(source, kind);
      input.data = read_volume<std::uint8_t>(source.path);
      break;
    case FileKind::kIgsio:
      input.data = read_sequence(source, input.warnings);
      break;
    case FileKind::kUltrasonix:
    case FileKind::kPropello:
      input.data = read_recording(source, kind);
      break;
    default:
      throw InputError(source.path.string(), "is a " + file_kind_name(kind) + ", not ultrasound");
  }
  return input;
}

}  // namespace usct
