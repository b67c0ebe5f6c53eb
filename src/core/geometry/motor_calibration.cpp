#include "us_ct_registration/geometry/motor_calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "require.h"

namespace usct {
namespace {

constexpr int kMinimumFramesPerHalf = 3;
constexpr int kIterations = 100;

/// The model that is fitted: two half sweeps that meet at angle 0 at `zero_frame`, and the distance
/// of the wires.
struct Sweep {
  double zero_frame;
  double step_before_rad;
  double step_after_rad;
  double distance_mm;

  double step_rad(double frame) const {
    return frame < zero_frame ? step_before_rad : step_after_rad;
  }
  double angle_rad(double frame) const { return step_rad(frame) * (frame - zero_frame); }
  double wires_mm(double frame) const { return distance_mm / std::cos(angle_rad(frame)); }

  /// Derivatives of `wires_mm` with respect to the zero frame, the two steps and the distance.
  Eigen::Vector4d gradient(double frame) const {
    const double angle = angle_rad(frame);
    const double by_angle = wires_mm(frame) * std::tan(angle);
    const double by_step = by_angle * (frame - zero_frame);
    const bool before = frame < zero_frame;
    return {-by_angle * step_rad(frame), before ? by_step : 0.0, before ? 0.0 : by_step,
            1.0 / std::cos(angle)};
  }
  Sweep moved(const Eigen::Vector4d& by) const {
    return {zero_frame + by[0], step_before_rad + by[1], step_after_rad + by[2],
            distance_mm + by[3]};
  }
};

/// Mean distance of one frame over the volumes that show the wires.
struct Observation {
  double frame;
  double distance_mm;
  double weight;  // number of volumes
};

std::vector<SliceAngle> average_over_volumes(const WireDistances& distances) {
  std::vector<SliceAngle> slices(distances.volumes.front().size());
  for (std::size_t frame = 0; frame < slices.size(); ++frame) {
    SliceAngle& slice = slices[frame];
    for (const std::vector<double>& volume : distances.volumes) {
      if (std::isnan(volume[frame])) continue;
      slice.distance_mm += volume[frame];
      ++slice.volumes;
    }
    if (slice.volumes > 0) slice.distance_mm /= slice.volumes;
  }
  return slices;
}

std::vector<Observation> observations_of(const std::vector<SliceAngle>& slices) {
  std::vector<Observation> observations;
  for (std::size_t frame = 0; frame < slices.size(); ++frame)
    if (slices[frame].volumes > 0)
      observations.push_back({static_cast<double>(frame), slices[frame].distance_mm,
                              static_cast<double>(slices[frame].volumes)});
  return observations;
}

double angle_of(double true_distance_mm, double distance_mm) {
  return distance_mm > true_distance_mm ? std::acos(true_distance_mm / distance_mm) : 0.0;
}

/// Initial values of the fit. The vertex of a parabola through all distances gives the zero frame,
/// since h is nearly quadratic there. The angles of the two outermost frames, divided by their
/// distances from the zero frame, give the steps.
Sweep first_guess(const std::vector<Observation>& observations, double true_distance_mm,
                  const std::string& source) {
  const auto n = static_cast<Eigen::Index>(observations.size());
  Eigen::MatrixXd powers(n, 3);
  Eigen::VectorXd distances(n);
  const double middle = 0.5 * (observations.front().frame + observations.back().frame);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Observation& o = observations[static_cast<std::size_t>(i)];
    const double f = o.frame - middle;
    powers.row(i) << 1.0, f, f * f;
    distances[i] = o.distance_mm;
  }
  const Eigen::Vector3d parabola = powers.colPivHouseholderQr().solve(distances);
  const double zero = middle - 0.5 * parabola[1] / parabola[2];
  const double first = observations.front().frame;
  const double last = observations.back().frame;
  // Rounding alone makes a parabola of distances that are all the same.
  constexpr double kLeastRiseMm = 0.01;
  if (distances.maxCoeff() - distances.minCoeff() < kLeastRiseMm)
    throw InputError(
        source, "the distance of the wires is the same in all frames: the motor has not moved");
  if (!(parabola[2] > 0.0) || !(zero > first && zero < last))
    throw InputError(source,
                     "the distance of the wires has no minimum within the sweep (vertex of the "
                     "parabola through it: frame " +
                         std::to_string(zero) + "), must have one between frames " +
                         std::to_string(static_cast<int>(first)) + " and " +
                         std::to_string(static_cast<int>(last)));
  // The step follows from the curvature of the parabola for a half whose outermost frame has no
  // angle by eq 3.1.
  const double slope = std::sqrt(2.0 * parabola[2] / true_distance_mm);
  const auto step = [&](const Observation& end) {
    const double angle = angle_of(true_distance_mm, end.distance_mm);
    return angle > 0.0 ? angle / std::abs(end.frame - zero) : slope;
  };
  return {zero, step(observations.front()), step(observations.back()), true_distance_mm};
}

struct Normal {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double cost = 0.0;
};

Normal normal_equations(const std::vector<Observation>& observations, const Sweep& sweep) {
  Normal normal;
  for (const Observation& o : observations) {
    const double residual = o.distance_mm - sweep.wires_mm(o.frame);
    const Eigen::Vector4d gradient = sweep.gradient(o.frame);
    normal.matrix += o.weight * gradient * gradient.transpose();
    normal.right += o.weight * gradient * residual;
    normal.cost += o.weight * residual * residual;
  }
  return normal;
}

/// Whether every angle of the sweep is below a right angle, and steps and distance are positive.
bool is_possible(const std::vector<Observation>& observations, const Sweep& sweep) {
  constexpr double kRightAngle = 1.5707963267948966;
  return sweep.step_before_rad > 0.0 && sweep.step_after_rad > 0.0 && sweep.distance_mm > 0.0 &&
         std::abs(sweep.angle_rad(observations.front().frame)) < kRightAngle &&
         std::abs(sweep.angle_rad(observations.back().frame)) < kRightAngle;
}

/// Levenberg-Marquardt over the first `parameters` parameters: 4 with the distance, 3 without.
Sweep fit(const std::vector<Observation>& observations, Sweep sweep, int parameters) {
  double damping = 1e-3;
  Normal normal = normal_equations(observations, sweep);
  for (int i = 0; i < kIterations; ++i) {
    Eigen::MatrixXd matrix = normal.matrix.topLeftCorner(parameters, parameters);
    matrix.diagonal() *= 1.0 + damping;
    Eigen::Vector4d step = Eigen::Vector4d::Zero();
    step.head(parameters) = matrix.ldlt().solve(normal.right.head(parameters));
    const Sweep candidate = sweep.moved(step);
    if (!step.allFinite() || !is_possible(observations, candidate)) {
      damping *= 10.0;
      continue;
    }
    const Normal next = normal_equations(observations, candidate);
    if (next.cost > normal.cost) {
      damping *= 10.0;
      continue;
    }
    sweep = candidate;
    normal = next;
    damping *= 0.1;
    if (std::abs(step[0]) < 1e-10) break;
  }
  return sweep;
}

void require_frames_on_both_sides(const MotorCalibration& result, const std::string& source) {
  for (const SweepHalf* half : {&result.before, &result.after})
    if (half->frames < kMinimumFramesPerHalf)
      throw InputError(source, "the smallest distance is at frame " +
                                   std::to_string(result.zero_frame) + ", which leaves " +
                                   std::to_string(half->frames) + " frames on one side, must be " +
                                   "at least " + std::to_string(kMinimumFramesPerHalf));
}

/// Sets the standard errors, which follow from the scatter about the fit.
void set_errors(MotorCalibration& result, const std::vector<Observation>& observations,
                const Sweep& sweep, int parameters) {
  const Normal normal = normal_equations(observations, sweep);
  const auto n = static_cast<double>(observations.size());
  double weights = 0.0;
  for (const Observation& o : observations) weights += o.weight;
  result.rms_residual_mm = std::sqrt(normal.cost / weights);
  const double variance = normal.cost / (n - parameters);
  const Eigen::MatrixXd covariance =
      variance * normal.matrix.topLeftCorner(parameters, parameters).inverse();
  result.zero_frame_standard_error = std::sqrt(covariance(0, 0));
  result.before.standard_error_rad = std::sqrt(covariance(1, 1));
  result.after.standard_error_rad = std::sqrt(covariance(2, 2));
  if (parameters > 3) result.distance_standard_error_mm = std::sqrt(covariance(3, 3));
}

void set_slice_angles(MotorCalibration& result, const Sweep& sweep, double sense,
                      double shortfall_tolerance, const std::string& source) {
  for (std::size_t i = 0; i < result.slices.size(); ++i) {
    SliceAngle& slice = result.slices[i];
    if (slice.volumes == 0) continue;
    const auto frame = static_cast<double>(i);
    slice.residual_mm = slice.distance_mm - sweep.wires_mm(frame);
    if (slice.distance_mm < sweep.distance_mm * (1.0 - shortfall_tolerance))
      throw InputError(source, "frame " + std::to_string(i) + " shows the wires " +
                                   std::to_string(slice.distance_mm) + " mm apart, must not be " +
                                   "more than " + std::to_string(100.0 * shortfall_tolerance) +
                                   " % below their true distance of " +
                                   std::to_string(sweep.distance_mm) +
                                   " mm: check the true distance, the sound speed and the "
                                   "segmentation");
    slice.angle_rad = angle_of(sweep.distance_mm, slice.distance_mm) * sense *
                      (frame < sweep.zero_frame ? -1.0 : 1.0);
    slice.status = slice.distance_mm > sweep.distance_mm ? SliceAngle::Status::kMeasured
                                                         : SliceAngle::Status::kAtMinimum;
  }
}

}  // namespace

void WireDistances::validate(const std::string& source) const {
  if (!std::isfinite(true_distance_mm) || true_distance_mm <= 0.0)
    throw InputError(source, "true distance is " + std::to_string(true_distance_mm) +
                                 " mm, must be finite and > 0");
  if (volumes.empty()) throw InputError(source, "has no volumes, must have at least 1");
  for (std::size_t volume = 0; volume < volumes.size(); ++volume) {
    const std::string name = "volume " + std::to_string(volume);
    if (volumes[volume].size() < 8 || volumes[volume].size() != volumes.front().size())
      throw InputError(source, name + " has " + std::to_string(volumes[volume].size()) +
                                   " frames, must have at least 8 and as many as the others (" +
                                   std::to_string(volumes.front().size()) + ")");
    for (std::size_t frame = 0; frame < volumes[volume].size(); ++frame) {
      const double h = volumes[volume][frame];
      if (std::isinf(h) || h <= 0.0)
        throw InputError(source, name + ", frame " + std::to_string(frame) + ": distance is " +
                                     std::to_string(h) + " mm, must be finite and > 0");
    }
  }
}

void MotorCalibrationOptions::validate(const std::string& source) const {
  require_positive(source, "shortfall_tolerance", shortfall_tolerance);
  require_positive(source, "residual_tolerance", residual_tolerance);
}

MotorCalibration calibrate_motor(const WireDistances& distances,
                                 const MotorCalibrationOptions& options,
                                 const std::string& source) {
  distances.validate(source);
  options.validate(source);
  MotorCalibration result;
  result.slices = average_over_volumes(distances);
  const std::vector<Observation> observations = observations_of(result.slices);
  if (observations.size() < 2 * kMinimumFramesPerHalf + 2)
    throw InputError(source, "the wires were found in " + std::to_string(observations.size()) +
                                 " frames, must be at least 8");
  const int parameters = options.fit_distance ? 4 : 3;
  const Sweep sweep =
      fit(observations, first_guess(observations, distances.true_distance_mm, source), parameters);

  result.zero_frame = sweep.zero_frame;
  result.distance_mm = sweep.distance_mm;
  const double sense = options.rising ? 1.0 : -1.0;
  result.before.step_rad = sense * sweep.step_before_rad;
  result.after.step_rad = sense * sweep.step_after_rad;
  for (const Observation& o : observations)
    ++(o.frame < sweep.zero_frame ? result.before : result.after).frames;
  require_frames_on_both_sides(result, source);
  set_slice_angles(result, sweep, sense, options.shortfall_tolerance, source);
  set_errors(result, observations, sweep, parameters);
  if (result.rms_residual_mm > options.residual_tolerance * sweep.distance_mm)
    throw InputError(source, "distances scatter about the fitted sweep by " +
                                 std::to_string(result.rms_residual_mm) + " mm RMS, must be <= " +
                                 std::to_string(options.residual_tolerance * sweep.distance_mm) +
                                 ": check the segmentation, or the steps within one half are not "
                                 "even");
  for (std::size_t frame = 0; frame < result.slices.size(); ++frame)
    result.frame_angles_rad.push_back(sense * sweep.angle_rad(static_cast<double>(frame)));
  return result;
}

}  // namespace usct
