#include "us_ct_registration/io/ultrasound/probe_config.h"

#include <cmath>

#include "io/ultrasound/recordable_sweep.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace {

/// The largest relative difference between the mean pitch of a calibrated table and the pitch that
/// the scanner recorded.
constexpr double kCalibratedPitchTolerance = 0.25;

void require_positive(const std::optional<double>& value, const std::string& source,
                      const std::string& key) {
  if (value && !(std::isfinite(*value) && *value > 0.0))
    throw InputError(source,
                     "'" + key + "' is " + format_double(*value) + ", must be finite and > 0");
}

void validate_sampling(const ProbeSampling& sampling, const std::string& source) {
  if (!std::isfinite(sampling.start_depth_mm) || sampling.start_depth_mm < 0.0)
    throw InputError(source, "'start_depth_mm' is " + format_double(sampling.start_depth_mm) +
                                 ", must be finite and >= 0");
  require_positive(sampling.sample_spacing_mm, source, "sample_spacing_mm");
  require_positive(sampling.imaging_depth_mm, source, "imaging_depth_mm");
  require_positive(sampling.sampling_frequency_hz, source, "sampling_frequency_hz");
  require_positive(sampling.speed_of_sound_m_per_s, source, "speed_of_sound_m_per_s");
  if (sampling.sample_spacing_mm.has_value() + sampling.imaging_depth_mm.has_value() +
          sampling.sampling_frequency_hz.has_value() >
      1)
    throw InputError(source,
                     "must have at most one of 'sample_spacing_mm', 'imaging_depth_mm' and "
                     "'sampling_frequency_hz'");
  if (sampling.sampling_frequency_hz && !sampling.speed_of_sound_m_per_s)
    throw InputError(source, "'sampling_frequency_hz' needs 'speed_of_sound_m_per_s'");
}

void validate_motor(const ProbeMotor& motor, const std::string& source) {
  require_positive(motor.step_rad, source, "motor_step_deg");
  if (motor.step_rad.has_value() != motor.frame_angles_rad.empty())
    throw InputError(source, "must have one of 'motor_step_deg' and 'frame_angles_deg'");
  if (motor.steps_per_frame && !motor.step_rad)
    throw InputError(source, "'motor_steps_per_frame' needs 'motor_step_deg'");
  if (motor.steps_per_frame && *motor.steps_per_frame < 1)
    throw InputError(source, "'motor_steps_per_frame' is " +
                                 std::to_string(*motor.steps_per_frame) + ", must be >= 1");
  if (!std::isfinite(motor.frame_travel_rad) || motor.frame_travel_rad < 0.0)
    throw InputError(source, "'frame_travel_deg' is " +
                                 format_double(degrees(motor.frame_travel_rad)) +
                                 ", must be finite and >= 0");
}

double spacing_mm(const ProbeSampling& sampling, const RecordedFrames& recorded,
                  const std::string& source) {
  if (sampling.sample_spacing_mm) return *sampling.sample_spacing_mm;
  if (sampling.imaging_depth_mm) return *sampling.imaging_depth_mm / recorded.samples;
  const std::optional<double> frequency = sampling.sampling_frequency_hz
                                              ? sampling.sampling_frequency_hz
                                              : recorded.sampling_frequency_hz;
  if (!frequency)
    throw InputError(source,
                     "does not say how far samples are apart; the probe's configuration must have "
                     "'sample_spacing_mm', 'imaging_depth_mm' or 'sampling_frequency_hz'");
  if (!sampling.speed_of_sound_m_per_s)
    throw InputError(source,
                     "says a sampling frequency; the probe's configuration must have "
                     "'speed_of_sound_m_per_s'");
  constexpr double kMillimetresPerMetre = 1000.0;
  return kMillimetresPerMetre * *sampling.speed_of_sound_m_per_s /
         (2.0 * *frequency);  // the echo travels there and back
}

[[noreturn]] void fail_pitch(int recorded, const std::string& expected, const std::string& source) {
  throw InputError(source, "angle between frames is " + std::to_string(recorded) +
                               " thousandths of a degree (truncated), must be " + expected);
}

/// Angle between frames from the motor's steps.
double pitch_from_steps(const ProbeMotor& motor, const std::optional<int>& recorded,
                        const std::string& source) {
  const double step = *motor.step_rad;
  if (motor.steps_per_frame) {
    const double pitch = *motor.steps_per_frame * step;
    const int expected = io::truncated_millidegrees(pitch);
    if (recorded && *recorded != expected)
      fail_pitch(*recorded,
                 std::to_string(expected) + ": the probe's configuration has " +
                     std::to_string(*motor.steps_per_frame) + " motor steps per frame",
                 source);
    return pitch;
  }
  if (!recorded)
    throw InputError(source,
                     "does not say how far frames are apart; the probe's configuration must have "
                     "'motor_steps_per_frame' or 'frame_angles_deg'");
  // The recorded value is truncated, so that the number of steps is this one or the next.
  const double lower = std::floor(*recorded / (1000.0 * degrees(step)));
  for (const double steps : {lower, lower + 1.0})
    if (steps >= 1.0 && io::truncated_millidegrees(steps * step) == *recorded) return steps * step;
  fail_pitch(*recorded,
             "a whole number of motor steps of " + format_double(degrees(step)) + " degrees",
             source);
}

std::vector<double> calibrated_angles(const ProbeMotor& motor, const RecordedFrames& recorded,
                                      const std::string& source) {
  const std::vector<double>& angles = motor.frame_angles_rad;
  if (angles.size() != static_cast<std::size_t>(recorded.frames))
    throw InputError(source, "has " + std::to_string(recorded.frames) +
                                 " frames per sweep, 'frame_angles_deg' of the probe's "
                                 "configuration has " +
                                 std::to_string(angles.size()) + " entries");
  const double mean_pitch = std::abs(angles.back() - angles.front()) / (recorded.frames - 1);
  const double mean = 1000.0 * degrees(mean_pitch);
  if (recorded.frame_pitch_millidegrees &&
      std::abs(*recorded.frame_pitch_millidegrees - mean) > kCalibratedPitchTolerance * mean)
    fail_pitch(
        *recorded.frame_pitch_millidegrees,
        "within 25 % of the mean of 'frame_angles_deg', " + std::to_string(std::lround(mean)),
        source);
  return angles;
}

/// The geometry without its motion, which the caller adds.
ScanGeometry still_geometry(const ProbeConfig& probe, const RecordedFrames& recorded,
                            const std::string& source) {
  probe.validate(source + ": probe's configuration");
  if (line_count(probe.array) != recorded.lines)
    throw InputError(source, "has " + std::to_string(recorded.lines) +
                                 " lines, the probe's configuration has " +
                                 std::to_string(line_count(probe.array)));
  ScanGeometry geometry;
  geometry.axial = {recorded.samples, probe.sampling.start_depth_mm,
                    spacing_mm(probe.sampling, recorded, source)};
  geometry.array = probe.array;
  return geometry;
}

}  // namespace

void ProbeConfig::validate(const std::string& source) const {
  validate_sampling(sampling, source);
  // ScanGeometry::validate checks the rest, with two samples and two frames in place of the data.
  ScanGeometry geometry;
  geometry.axial = {2, sampling.start_depth_mm, 1.0};
  geometry.array = array;
  geometry.motion = TrackedSweep{{Eigen::Isometry3d::Identity()}, {}};
  if (motor) {
    validate_motor(*motor, source);
    const std::vector<double> two = {0.0, 1.0};
    geometry.motion = MotorSweep{motor->motor_radius_mm,
                                 motor->frame_angles_rad.empty() ? two : motor->frame_angles_rad,
                                 motor->frame_travel_rad};
  }
  geometry.validate(source);
}

ScanGeometry motorised_geometry(const ProbeConfig& probe, const RecordedFrames& recorded,
                                const std::string& source) {
  if (!probe.motor)
    throw InputError(source, "needs a pose per frame: the probe's configuration has no motor");
  ScanGeometry geometry = still_geometry(probe, recorded, source);
  const ProbeMotor& motor = *probe.motor;
  MotorSweep sweep;
  sweep.motor_radius_mm = motor.motor_radius_mm;
  sweep.frame_angles_rad =
      motor.step_rad
          ? centred_table(recorded.frames,
                          pitch_from_steps(motor, recorded.frame_pitch_millidegrees, source))
          : calibrated_angles(motor, recorded, source);
  if (recorded.backward)
    sweep.frame_angles_rad = {sweep.frame_angles_rad.rbegin(), sweep.frame_angles_rad.rend()};
  const bool rising = sweep.frame_angles_rad.front() < sweep.frame_angles_rad.back();
  sweep.frame_travel_rad = rising ? motor.frame_travel_rad : -motor.frame_travel_rad;
  geometry.motion = sweep;
  geometry.validate(source);
  return geometry;
}

ScanGeometry tracked_geometry(const ProbeConfig& probe, const RecordedFrames& recorded,
                              const TrackedSweep& sweep, const std::string& source) {
  if (probe.motor)
    throw InputError(source, "has a pose per frame, but the probe's configuration has a motor");
  ScanGeometry geometry = still_geometry(probe, recorded, source);
  if (sweep.T_us_frame.size() != static_cast<std::size_t>(recorded.frames))
    throw InputError(source, "has " + std::to_string(recorded.frames) + " frames for " +
                                 std::to_string(sweep.T_us_frame.size()) + " poses");
  geometry.motion = sweep;
  geometry.validate(source);
  return geometry;
}

}  // namespace usct
