#include "us_ct_registration/phantom/endoscope.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "phantom/check.h"
#include "phantom/lens.h"
#include "phantom/operating_field.h"
#include "phantom/scenes.h"
#include "phantom/tissue_look.h"
#include "random.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

constexpr double kDistanceMm = 128.0;
constexpr double kFarthestMm = 260.0;

/// Camera at `from` that looks at `at`; its x axis is as close as can be to `right`.
Isometry3d looking_at(const Vector3d& from, const Vector3d& at, const Vector3d& right) {
  Isometry3d T = Isometry3d::Identity();
  T.translation() = from;
  const Vector3d z = (at - from).normalized();
  const Vector3d x = (right - right.dot(z) * z).normalized();
  T.linear() << x, z.cross(x), z;
  return T;
}

/// The direction from which a surgeon has the tumour in view: from its side of the kidney, and from
/// the patient's front and flank rather than from the poles.
Vector3d towards_camera(const Scene& scene, const Vector3d& tumour_mm) {
  Vector3d outwards = (tumour_mm - scene.kidney_centre_ct_mm).normalized();
  outwards.z() *= 0.4;
  const Vector3d flank = -scene.T_ct_probe.linear().col(1);
  const Vector3d front = (0.4 * flank + 0.6 * Vector3d(0.0, -1.0, 0.0)).normalized();
  return (outwards + 0.45 * front).normalized();
}

/// An instrument whose tip is at a point of the camera's frame and whose shaft comes from the side
/// of the camera; `side` is -1 for the left and 1 for the right hand.
void add_instrument(const Isometry3d& T_ct_camera, const Vector3d& tip_mm, double side,
                    double opening_rad, std::vector<Rod>& rods) {
  const Vector3d from_tip = Vector3d(side * 0.80, 0.42, -0.43).normalized();
  const Vector3d across = from_tip.cross(Vector3d::UnitZ()).normalized();
  const auto add = [&](const Vector3d& a, const Vector3d& b, double radius, bool metal) {
    rods.push_back({T_ct_camera * a, T_ct_camera * b, radius, metal});
  };
  const Vector3d hinge = tip_mm + 11.0 * from_tip;
  for (const double jaw : {-1.0, 1.0})
    add(hinge, tip_mm + jaw * 11.0 * std::tan(opening_rad) * across, 1.1, true);
  add(hinge, hinge + 9.0 * from_tip, 2.7, true);
  add(hinge + 11.0 * from_tip, hinge + 200.0 * from_tip, 4.0, false);
}

/// The instruments at a time, in the coordinates of the CT: one beside the tumour and one that
/// reaches over its edge now and then. `T_ct_camera` is the pose of the camera at rest.
std::vector<Rod> instruments_at(double time_s, int count, const Isometry3d& T_ct_camera,
                                const OperatingField& field) {
  const Vector3d tumour = T_ct_camera.inverse() * field.tumour_centre_mm();
  const double radius = field.tumour_radius_mm();
  const double swing = std::sin(2.0 * kPi * time_s / 3.1);
  std::vector<Rod> rods;
  if (count > 0)
    add_instrument(
        T_ct_camera,
        tumour + Vector3d(-0.75 * radius - 3.0 + 4.0 * swing, 0.35 * radius + 2.0, -radius - 2.0),
        -1.0, 0.14 + 0.1 * swing, rods);
  if (count > 1)
    add_instrument(T_ct_camera,
                   tumour + Vector3d(1.5 * radius + 4.0, 0.9 * radius + 3.0 * swing, -0.8 * radius),
                   1.0, 0.2, rods);
  return rods;
}

/// The light that a surface returns to the camera, whose light shines on it; red, green, blue,
/// linear.
Vector3d lit(const Look& look, const Vector3d& normal, const Sight& sight, double distance_mm,
             double openness) {
  const double facing = std::max(0.0, -normal.dot(sight.direction));
  const double falloff = kDistanceMm * kDistanceMm / (distance_mm * distance_mm);
  const double highlight = 1.3 * look.gloss * std::pow(facing, 90.0);
  const double open = 0.35 + 0.65 * openness;
  return falloff * open *
         ((0.06 + 0.94 * facing) * look.colour + highlight * Vector3d(1.0, 0.97, 0.92));
}

/// A filter of 1, 2, 1 along both axes: the blur of the optics.
std::vector<float> blurred(const std::vector<float>& image, int width, int height) {
  std::vector<float> across(image.size());
  std::vector<float> result(image.size());
  const auto at = [&](int x, int y) {
    return 3 * (static_cast<std::size_t>(std::clamp(y, 0, height - 1)) *
                    static_cast<std::size_t>(width) +
                static_cast<std::size_t>(std::clamp(x, 0, width - 1)));
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (std::size_t c = 0; c < 3; ++c)
        across[at(x, y) + c] = 0.25F * image[at(x - 1, y) + c] + 0.5F * image[at(x, y) + c] +
                               0.25F * image[at(x + 1, y) + c];
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (std::size_t c = 0; c < 3; ++c)
        result[at(x, y) + c] = 0.25F * across[at(x, y - 1) + c] + 0.5F * across[at(x, y) + c] +
                               0.25F * across[at(x, y + 1) + c];
  return result;
}

/// 8-bit values of linear light, with noise.
std::vector<std::uint8_t> developed(const std::vector<float>& light, double noise,
                                    std::uint64_t seed) {
  std::vector<std::uint8_t> values(light.size());
  for (std::size_t i = 0; i < light.size(); ++i) {
    const double grey = 255.0 * std::pow(std::clamp<double>(light[i], 0.0, 1.0), 1.0 / 2.2);
    values[i] = static_cast<std::uint8_t>(
        std::lround(std::clamp(grey + noise * normal(hash(seed, i)), 0.0, 255.0)));
  }
  return values;
}

Vector3d colour_of(const OperatingField::Hit& hit, const Sight& sight,
                   const OperatingField& surfaces, const std::vector<Rod>& rods,
                   std::uint64_t seed) {
  const Vector3d p = sight.at(hit.distance_mm);
  if (hit.rod >= 0) {
    const bool metal = rods[static_cast<std::size_t>(hit.rod)].is_metal;
    const Look look{metal ? Vector3d(0.42, 0.43, 0.45) : Vector3d(0.035, 0.035, 0.04),
                    metal ? 0.9 : 0.25};
    return lit(look, hit.normal, sight, hit.distance_mm, 1.0);
  }
  // Fine ripples of the wet surface break the highlights up.
  const Vector3d ripples(smooth_noise(seed + 7, p / 2.3), smooth_noise(seed + 8, p / 2.3),
                         smooth_noise(seed + 9, p / 2.3));
  const Vector3d normal = (hit.normal + 0.07 * ripples).normalized();
  return lit(look_of(hit.tissue, p, seed), normal, sight, hit.distance_mm,
             surfaces.openness(p, hit.normal));
}

}  // namespace

void EndoscopeOptions::validate() const {
  require_range("width", width, 64, 4096);
  require_range("height", height, 64, 4096);
  require_range("field_of_view_deg", field_of_view_deg, 20.0, 100.0);
  for (const double coefficient : distortion) require_range("distortion", coefficient, -1.0, 1.0);
  require_range("baseline_mm", baseline_mm, 0.0, 20.0);
  require_range("frames", frames, 1, 10000);
  require_range("rate_hz", rate_hz, 0.1, 1000.0);
  require_range("camera_motion_mm", camera_motion_mm, 0.0, 30.0);
  require_range("endoscope_breathing_mm", breathing_mm, 0.0, 30.0);
  require_range("endoscope_breathing_period_s", breathing_period_s, 1.0, 20.0);
  require_range("instruments", instruments, 0, 2);
  require_range("noise", noise, 0.0, 50.0);
}

struct Endoscope::Field {
  OperatingField surfaces;
  std::vector<Eigen::Vector2f> lines_of_sight;
};

Endoscope::Endoscope(const PhantomOptions& phantom, const EndoscopeOptions& options)
    : options_(options), seed_(hash(phantom.seed, 0xE5C0)) {
  options.validate();
  if (phantom.scene != SceneKind::kPatient)
    throw InputError("endoscope", "the scene is " + to_string(phantom.scene) + ", must be patient");
  intrinsics_.width = options.width;
  intrinsics_.height = options.height;
  intrinsics_.fx = 0.5 * options.width / std::tan(0.5 * options.field_of_view_deg * kDegree);
  intrinsics_.fy = intrinsics_.fx;
  // The optical axis does not meet the sensor in its middle.
  intrinsics_.cx = 0.508 * options.width;
  intrinsics_.cy = 0.489 * options.height;
  std::copy(options.distortion.begin(), options.distortion.end(), intrinsics_.distortion.begin());

  const Scene scene = make_patient_scene(phantom.seed, phantom.anatomy);
  Field field{OperatingField(scene, seed_), lines_of_sight(intrinsics_)};
  tumour_centre_ct_mm_ = field.surfaces.tumour_centre_mm();
  aim_ct_mm_ = 0.55 * scene.kidney_centre_ct_mm + 0.45 * tumour_centre_ct_mm_;
  const Vector3d backwards = towards_camera(scene, tumour_centre_ct_mm_);
  T_ct_rest_ = looking_at(aim_ct_mm_ + kDistanceMm * backwards, aim_ct_mm_, Vector3d::UnitZ());
  field.surfaces.lay_bed(-backwards);
  field_ = std::make_unique<const Field>(std::move(field));
}

Endoscope::~Endoscope() = default;
Endoscope::Endoscope(Endoscope&&) noexcept = default;

Vector3d Endoscope::shift_ct_mm(int frame) const {
  const double phase = 2.0 * kPi * time_s(frame) / options_.breathing_period_s;
  return {0.0, 0.0, 0.5 * options_.breathing_mm * std::sin(phase)};
}

Isometry3d Endoscope::T_ct_camera(Eye eye, int frame) const {
  constexpr double kPeriodS = 5.3;
  const double phase = 2.0 * kPi * time_s(frame) / kPeriodS;
  const Vector3d moved =
      options_.camera_motion_mm * Vector3d(std::sin(phase), 0.6 * std::cos(0.7 * phase), 0.0);
  const Isometry3d left = looking_at(T_ct_rest_ * moved, aim_ct_mm_, T_ct_rest_.linear().col(0));
  return eye == Eye::kLeft ? left : left * Translation3d(options_.baseline_mm, 0.0, 0.0);
}

EndoscopeImage Endoscope::image(Eye eye, int frame) const {
  if (frame < 0 || frame >= options_.frames)
    throw InputError("endoscope", "'frame' is " + std::to_string(frame) + ", must be within [0, " +
                                      std::to_string(options_.frames - 1) + "]");
  const OperatingField& surfaces = field_->surfaces;
  // In coordinates that move with the anatomy, camera and instruments move the other way.
  const Translation3d back(-shift_ct_mm(frame));
  const Isometry3d T_camera = back * T_ct_camera(eye, frame);
  const std::vector<Rod> rods =
      instruments_at(time_s(frame), options_.instruments, back * T_ct_rest_, surfaces);
  const int width = options_.width;
  const int height = options_.height;
  const std::size_t pixels = field_->lines_of_sight.size();
  EndoscopeImage image{
      width, height, {}, std::vector<std::uint8_t>(pixels), std::vector<std::uint8_t>(pixels)};
  std::vector<float> light(3 * pixels);
  parallel_for(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(x);
      const Vector3d line = field_->lines_of_sight[i].cast<double>().homogeneous();
      const Sight sight{T_camera.translation(), T_camera.linear() * line.normalized()};
      if (surfaces.meets_tumour(sight)) image.tumour[i] = 255;
      const auto hit = surfaces.first_hit(sight, rods, kFarthestMm);
      if (!hit) continue;
      if (hit->rod >= 0) image.instrument[i] = 255;
      // A lens darkens towards the edge of its image.
      const double vignette = std::pow(line.squaredNorm(), -1.5);
      const Vector3d colour = vignette * colour_of(*hit, sight, surfaces, rods, seed_);
      for (int channel = 0; channel < 3; ++channel)
        light[3 * i + static_cast<std::size_t>(channel)] = static_cast<float>(colour[channel]);
    }
  });
  image.rgb = developed(
      blurred(light, width, height), options_.noise,
      hash(hash(seed_, static_cast<std::uint64_t>(frame)), static_cast<std::uint64_t>(eye)));
  return image;
}

}  // namespace usct::phantom
