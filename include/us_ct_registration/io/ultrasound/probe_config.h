#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"

/// The geometry of a probe, which the headers of ultrasound scanners lack, from a YAML file
/// (config/probes/ holds some; each key is explained there). Files are in millimetres and degrees.
///
/// | key | kind | meaning |
/// |---|---|---|
/// | `name` | all | for people |
/// | `kind` | all | `motorised_curvilinear`, `curvilinear` or `linear` |
/// | `probe_radius_mm` | curvilinear | centre of curvature to the array's surface |
/// | `lines`, `line_pitch_deg` | curvilinear | evenly spaced lines, centred on the axis |
/// | `line_angles_deg` | curvilinear | instead: one angle per line |
/// | `lines`, `line_pitch_mm` | linear | evenly spaced lines, centred on the axis |
/// | `line_positions_mm` | linear | instead: one position per line |
/// | `motor_radius_mm` | motorised | motor axis to the array's surface |
/// | `motor_step_deg`, `motor_steps_per_frame` | motorised | even frames, centred on zero |
/// | `frame_angles_deg` | motorised | instead: one (calibrated) angle per frame of a sweep |
/// | `frame_travel_deg` | motorised, optional | motor travel during one frame, 0 if absent |
/// | `start_depth_mm` | all | first sample below the array's surface |
/// | `sample_spacing_mm` | all, optional | pitch of the samples along a line |
/// | `imaging_depth_mm` | all, optional | instead: samples x pitch |
/// | `sampling_frequency_hz` | all, optional | instead: pitch = speed of sound / (2 frequency) |
/// | `speed_of_sound_m_per_s` | all, optional | for the frequency, this one or the data file's |
namespace usct {

/// The motor of a motorised probe.
struct ProbeMotor {
  double motor_radius_mm = 0.0;
  /// One step of the motor; empty if the frame angles are a table.
  std::optional<double> step_rad;
  /// Empty if the data file states it (a Propello file does).
  std::optional<int> steps_per_frame;
  /// One angle per frame of a sweep in the first direction; empty if they follow from the steps.
  std::vector<double> frame_angles_rad;
  /// Travel during one frame in the direction of the sweep, >= 0.
  double frame_travel_rad = 0.0;
};

/// Positions of the samples along a line. At most one of spacing, depth and frequency is set; if
/// none is, the data file must give the frequency (an Ultrasonix file does).
struct ProbeSampling {
  double start_depth_mm = 0.0;
  std::optional<double> sample_spacing_mm;
  std::optional<double> imaging_depth_mm;
  std::optional<double> sampling_frequency_hz;
  std::optional<double> speed_of_sound_m_per_s;
};

struct ProbeConfig {
  std::string name;
  Array array;
  std::optional<ProbeMotor> motor;  // a motorised probe
  ProbeSampling sampling;

  /// Throws InputError, naming `source`, the key, its value and the constraint.
  void validate(const std::string& source) const;
};

/// Throws InputError, naming file and key, for a key that is unknown, missing, given twice, of
/// another kind of probe, contradicted by another, of the wrong type, or out of range.
ProbeConfig read_probe_config(const std::filesystem::path& path);

/// Writes the whole file anew, atomically, each key with a comment; used by the calibration of the
/// motor. Evenly spaced lines (within 1e-12 of a radian or millimetre) are written as a pitch.
void write_probe_config(const ProbeConfig& probe, const std::filesystem::path& path);

/// The part of the geometry that a data file states itself, beside the probe's configuration.
struct RecordedFrames {
  int samples = 0;
  int lines = 0;
  int frames = 0;  // of one sweep
  std::optional<double> sampling_frequency_hz;
  /// The angle between frames in whole thousandths of a degree, truncated (Propello).
  std::optional<int> frame_pitch_millidegrees;
  /// Whether the sweep runs against the first direction: frame angles in reverse order, travel
  /// negative.
  bool backward = false;
};

/// The geometry of one sweep of a motorised probe.
///
/// Throws InputError, naming `source`, if the probe has no motor; if the data have another number
/// of lines, or of frames than `frame_angles_deg`; if sampling or frame angles are not known; or if
/// the recorded frame pitch contradicts the probe: another number than the truncated motor steps,
/// or, for a calibrated table, more than 25 % off its mean pitch (the thesis calibrated 0.611
/// degrees where 0.731 were recorded).
ScanGeometry motorised_geometry(const ProbeConfig& probe, const RecordedFrames& recorded,
                                const std::string& source);

/// The geometry of tracked frames, one pose each. Throws InputError, naming `source`, if the probe
/// is motorised, or the numbers of lines or frames differ, or the sampling is not known.
ScanGeometry tracked_geometry(const ProbeConfig& probe, const RecordedFrames& recorded,
                              const TrackedSweep& sweep, const std::string& source);

/// Entry in the table of formats: see FileFormat::describe.
std::string describe_probe_config(const std::filesystem::path& path);

}  // namespace usct
