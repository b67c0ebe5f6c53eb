#include "us_ct_registration/ultrasound/streamed_frame.h"

#include <cmath>
#include <limits>

#include "ultrasound/nanoseconds.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

void validate_image(const StreamedFrame& frame, const std::string& source) {
  // A frame is checked as a tracked sweep of one frame.
  const ScanGeometry geometry{frame.axial, frame.array,
                              TrackedSweep{{Eigen::Isometry3d::Identity()}, {}}};
  geometry.validate(source);
  const std::size_t expected =
      static_cast<std::size_t>(geometry.samples()) * static_cast<std::size_t>(geometry.lines());
  const std::size_t found = frame.brightness ? frame.brightness->size() : 0;
  if (found != expected)
    throw InputError(source, "'brightness' has " + std::to_string(found) + " values, must have " +
                                 std::to_string(geometry.samples()) + " x " +
                                 std::to_string(geometry.lines()));
}

void validate_motor(const MotorFrame& motor, const std::string& source) {
  if (!std::isfinite(motor.angle_rad) || !std::isfinite(motor.travel_rad))
    throw InputError(source, "'motor_angle' and 'motor_travel' must be finite");
  if (!(motor.motor_radius_mm > 0.0))
    throw InputError(
        source, "'motor_radius' is " + std::to_string(motor.motor_radius_mm) + " mm, must be > 0");
}

void validate_stamp(const StreamedFrame& frame, double image_lag_s, const std::string& source) {
  const double stamp_s = seconds_from(frame.stamp_ns);
  const double shown_s = stamp_s - image_lag_s;
  if (frame.stamp_ns <= 0 || shown_s <= 0.0 || shown_s >= std::numeric_limits<std::uint32_t>::max())
    throw InputError(source, "'stamp' is " + std::to_string(stamp_s) +
                                 " s, must be the time of the acquisition, later than the image "
                                 "lag of " +
                                 std::to_string(image_lag_s) + " s");
}

}  // namespace

std::string StreamedFrame::name() const {
  return "sweep " + std::to_string(sweep) + " frame " + std::to_string(index);
}

void StreamedFrame::validate(double image_lag_s) const {
  const std::string source = name();
  validate_image(*this, source);
  if (motor) validate_motor(*motor, source);
  validate_stamp(*this, image_lag_s, source);
  if (frames_in_sweep > 0 && index >= frames_in_sweep)
    throw InputError(source, "'index' must be below 'frames_in_sweep', which is " +
                                 std::to_string(frames_in_sweep));
  if (frame_id.empty() && !(pose && pose->at_stamp))
    throw InputError(source, "'frame_id' is empty, must name the ultrasound's frame");
}

}  // namespace usct
