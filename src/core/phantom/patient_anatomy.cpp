#include "phantom/patient_anatomy.h"

#include <algorithm>
#include <cmath>

#include "us_ct_registration/geometry/angles.h"

namespace usct::phantom {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

constexpr double kFasciaMm = 0.7;
constexpr double kCorticalShellMm = 1.3;
constexpr double kVertebraPitchMm = 38.0;

/// Squared normalised distance from the axis of an elliptic cylinder or ellipsoid: 1 on its
/// surface.
double ellipse(double x, double rx, double y, double ry, double z = 0.0, double rz = 1.0) {
  return (x * x) / (rx * rx) + (y * y) / (ry * ry) + (z * z) / (rz * rz);
}

KidneyContent content_of(const AnatomyOptions& options) {
  KidneyContent content;
  content.tumour = options.tumour;
  content.cyst = options.cyst;
  content.stone = options.stone;
  content.calyx_scale = 1.15;
  return content;
}

std::optional<Tissue> spine_tissue(const Vector3d& p) {
  const double canal = ellipse(p.x(), 11.0, p.y() - 69.0, 8.0);
  if (canal < 1.0) return Tissue::kFat;
  const double body = std::sqrt(ellipse(p.x(), 24.0, p.y() - 44.0, 17.5));
  if (body > 1.0) return std::nullopt;
  const double within = p.z() / kVertebraPitchMm - std::floor(p.z() / kVertebraPitchMm);
  const double to_endplate_mm = (0.36 - std::abs(within - 0.5)) * kVertebraPitchMm;
  if (to_endplate_mm < 0.0) return Tissue::kDisc;
  const bool shell = to_endplate_mm < kCorticalShellMm || (1.0 - body) * 20.0 < kCorticalShellMm;
  return shell ? Tissue::kCorticalBone : Tissue::kSpongyBone;
}

}  // namespace

PatientAnatomy::PatientAnatomy(std::uint64_t seed, const AnatomyOptions& options)
    : seed_(hash(seed, 0xB0D)), kidney_(seed, content_of(options)) {
  Sequence random(seed, 0x9A7);
  right_ = random.next() % 2 == 0;
  const Vector3d origin(random.between(-30.0, 30.0), random.between(-230.0, -120.0),
                        random.between(-700.0, -200.0));
  T_ct_torso_ = Translation3d(origin) *
                AngleAxisd(random.gaussian(0.0, 6.0) * kDegree, Vector3d::UnitZ()) *
                AngleAxisd(random.gaussian(0.0, 3.0) * kDegree, Vector3d::UnitX());
  T_torso_ct_ = T_ct_torso_.inverse();
  half_width_mm_ = random.between(142.0, 156.0);
  half_depth_mm_ = random.between(100.0, 116.0);
  fat_mm_ = random.between(7.0, 16.0);
  muscle_mm_ = random.between(11.0, 16.0);
  gerota_ = random.between(1.28, 1.5);
  place_kidney(random);
  place_bones(random);
  place_vessels();
  place_bowel(random);
  place_bubbles(random, options.bubbles);
}

Tissue PatientAnatomy::tissue(const Vector3d& p_ct_mm) const {
  const Vector3d p = torso_from_ct(p_ct_mm);
  const double depth = depth_below_skin(p);
  if (depth < 0.0) return Tissue::kAir;
  if (const auto bone = bones_.find(p))
    return bone->depth_mm < kCorticalShellMm ? Tissue::kCorticalBone : Tissue::kSpongyBone;
  if (depth < kSkinMm + 1.6 * (fat_mm_ + muscle_mm_))
    if (const auto layer = wall_tissue(p, depth)) return *layer;
  if (p.x() > 0.0)
    if (const auto found = kidney_tissue(p)) return *found;
  return interior_tissue(p);
}

Vector3d PatientAnatomy::texture_point_mm(const Vector3d& p_ct_mm, Tissue tissue) const {
  Vector3d p = torso_from_ct(p_ct_mm);
  const double depth = depth_below_skin(p);
  if (depth > 45.0 && tissue != Tissue::kMuscle) return p;
  return {130.0 * std::atan2(p.y(), p.x()), depth, p.z()};
}

Vector3d PatientAnatomy::skin_normal(const Vector3d& p) const {
  return Vector3d(p.x() / (half_width_mm_ * half_width_mm_),
                  p.y() / (half_depth_mm_ * half_depth_mm_), 0.0)
      .normalized();
}

Vector3d PatientAnatomy::skin_point(const Vector3d& from, const Vector3d& outwards) const {
  double t = 0.0;
  while (depth_below_skin(from + t * outwards) > 0.0) t += 0.25;
  return from + t * outwards;
}

double PatientAnatomy::depth_below_skin(const Vector3d& p) const {
  const double a = half_width_mm_ + 3e-4 * p.z() * p.z();  // narrowest at the waist
  const double b = half_depth_mm_;
  const double rho = std::sqrt(ellipse(p.x(), a, p.y(), b));
  const double slope = std::sqrt(ellipse(p.x(), a * a, p.y(), b * b)) / std::max(rho, 1e-6);
  return std::min((1.0 - rho) / std::max(slope, 1e-6), 80.0);
}

std::optional<Tissue> PatientAnatomy::wall_tissue(const Vector3d& p, double depth) const {
  if (depth < kSkinMm) return Tissue::kSkin;
  const Vector3d along(3.5 * std::atan2(p.y(), p.x()), p.z() / 37.0, 0.0);
  double layer = kSkinMm + fat_mm_ + 1.3 * smooth_noise(seed_, along);
  if (depth < layer) return Tissue::kSubcutaneousFat;
  // The layers are external oblique, internal oblique and transversus, each below its fascia.
  constexpr double kShare[] = {0.38, 0.38, 0.24};
  for (int i = 0; i < 3; ++i) {
    if (depth < layer + kFasciaMm) return Tissue::kFascia;
    const double thickness =
        kShare[i] * muscle_mm_ *
        (1.0 + 0.14 * smooth_noise(hash(seed_, static_cast<std::uint64_t>(i)), along));
    if (depth < layer + kFasciaMm + thickness) return Tissue::kMuscle;
    layer += kFasciaMm + thickness;
  }
  if (depth < layer + kFasciaMm) return Tissue::kFascia;
  return std::nullopt;
}

std::optional<Tissue> PatientAnatomy::kidney_tissue(const Vector3d& p) const {
  const Vector3d q = T_kidney_torso_ * p;
  if (q.squaredNorm() > 100.0 * 100.0) return std::nullopt;
  if (const auto found = kidney_.tissue(q)) return found;
  // There is more fat behind and below the kidney than in front of it.
  double rho = kidney_.radial(q - Vector3d(-3.0, 1.0, 0.0));
  if (rho > 1.3 * gerota_) return std::nullopt;
  rho *= 1.0 + 0.05 * smooth_noise(hash(seed_, 3), p / 22.0);
  if (rho < gerota_) return Tissue::kPerirenalFat;
  if (rho < gerota_ + 0.022) return Tissue::kFascia;
  return std::nullopt;
}

std::optional<Tissue> PatientAnatomy::muscle_or_vessel(const Vector3d& p) const {
  if (const auto vessel = vessels_.find(p)) return vessel->tissue;
  const double x = std::abs(p.x());
  const double lower = std::max(0.0, -p.z()) * 0.12;
  for (const double muscle :
       {ellipse(x - 37.0 - lower, 17.0 + lower, p.y() - 42.0, 21.0 + lower),
        ellipse(x - 66.0, 25.0, p.y() - 72.0, 9.5), ellipse(x - 34.0, 30.0, p.y() - 82.0, 17.0)}) {
    if (muscle < 0.93) return Tissue::kMuscle;
    if (muscle < 1.0) return Tissue::kFascia;
  }
  return std::nullopt;
}

std::optional<Tissue> PatientAnatomy::bowel_tissue(const Vector3d& p) const {
  for (const Loop& loop : bowel_) {
    const Vector3d offset = p - loop.centre;
    if ((offset.array().abs() > loop.radii.array()).any()) continue;
    const double rho = offset.cwiseQuotient(loop.radii).norm();
    if (rho > 1.0) continue;
    const double wall = 2.5 / loop.radii.minCoeff();
    // Gas rises to the anterior side, with foam below it.
    const double level = loop.gas_level + 0.25 * smooth_noise(hash(seed_, 5), p / 4.0);
    const bool gas = offset.y() / loop.radii.y() < level && rho < 1.0 - wall;
    return gas ? Tissue::kGas : Tissue::kBowel;
  }
  return std::nullopt;
}

/// Whether a point lies in an ellipsoid with a wavy surface.
bool PatientAnatomy::within_organ(const Vector3d& p, const Vector3d& centre,
                                  const Vector3d& radii) const {
  const double rho = (p - centre).cwiseQuotient(radii).squaredNorm();
  if (rho < 0.7 || rho > 1.3) return rho < 1.0;
  return rho < 1.0 + 0.06 * smooth_noise(hash(seed_, 4), p / 30.0);
}

Tissue PatientAnatomy::interior_tissue(const Vector3d& p) const {
  if (const auto spine = spine_tissue(p)) return *spine;
  if (const auto found = muscle_or_vessel(p)) return *found;
  if (within_organ(p, {72.0, 22.0, 190.0}, {74.0, 92.0, 112.0})) return Tissue::kGas;  // lung
  if (right_) {
    if (within_organ(p, {42.0, -38.0, 62.0}, {82.0, 72.0, 92.0})) return Tissue::kLiver;
  } else if (within_organ(p, {86.0, 12.0, 72.0}, {34.0, 52.0, 50.0})) {
    return Tissue::kSpleen;
  }
  if (const auto found = bowel_tissue(p)) return *found;
  return Tissue::kFat;
}

void PatientAnatomy::place_kidney(Sequence& random) {
  // The upper pole is medial and posterior; the hilum faces the spine and forwards.
  const Vector3d upper = Vector3d(-random.between(0.18, 0.34), random.between(0.05, 0.2), 1.0);
  const double turn = random.between(20.0, 45.0) * kDegree;
  Eigen::Matrix3d R;
  R.col(0) = upper.normalized();
  R.col(1) = Vector3d(std::cos(turn), std::sin(turn), 0.0);
  R.col(1) = (R.col(1) - R.col(1).dot(R.col(0)) * R.col(0)).normalized();
  R.col(2) = R.col(0).cross(R.col(1));
  T_torso_kidney_ = Translation3d(random.between(70.0, 76.0), random.between(26.0, 34.0),
                                  random.gaussian(0.0, 4.0)) *
                    Isometry3d(R);
  T_kidney_torso_ = T_torso_kidney_.inverse();
}

/// A point at some depth below the skin, at an angle from posterior towards lateral.
Vector3d PatientAnatomy::wall_point(double angle_deg, double z, double depth_mm) const {
  const double angle = angle_deg * kDegree;
  return skin_point(Vector3d(0, 0, z), Vector3d(std::sin(angle), std::cos(angle), 0.0)) -
         depth_mm * Vector3d(std::sin(angle), std::cos(angle), 0.0);
}

void PatientAnatomy::place_bones(Sequence& random) {
  const double inner = kSkinMm + fat_mm_ + muscle_mm_ - 2.0;
  struct Rib {
    double z_mm, end_deg, drop_mm;
  };
  const double shift = random.between(-4.0, 8.0);
  for (const Rib& rib : {Rib{48.0, 58.0, 30.0}, Rib{84.0, 88.0, 52.0}, Rib{120.0, 125.0, 72.0}}) {
    std::vector<Vector3d> points = {{22.0, 62.0, rib.z_mm + shift}, {38.0, 74.0, rib.z_mm + shift}};
    for (int i = 0; i <= 5; ++i) {
      const double t = 0.3 + 0.14 * i;
      points.push_back(wall_point(18.0 + t * (rib.end_deg - 18.0),
                                  rib.z_mm + shift - rib.drop_mm * t * t, inner));
    }
    bones_.add_curve(points, 5.0, 4.2, Tissue::kCorticalBone);
  }
  for (int level = -4; level <= 4; ++level) {
    const double z = (level + 0.5) * kVertebraPitchMm;
    for (const double side : {-1.0, 1.0}) {
      bones_.add({side * 16.0, 60.0, z}, {side * 44.0, 68.0, z + 3.0}, 5.0, 3.5,
                 Tissue::kCorticalBone);
      bones_.add({side * 15.0, 62.0, z}, {0.0, 82.0, z - 8.0}, 4.0, 4.0, Tissue::kCorticalBone);
    }
    bones_.add({0.0, 82.0, z - 8.0}, {0.0, 95.0, z - 12.0}, 4.0, 4.5, Tissue::kCorticalBone);
  }
  bones_.build_raster();
}

void PatientAnatomy::place_vessels() {
  // x points to the kidney's side, so aorta (left) and cava (right) change places.
  const double side = right_ ? -1.0 : 1.0;
  const Vector3d aorta(side * 11.0, 15.0, 0.0);
  const Vector3d cava(side * -16.0, 17.0, 0.0);
  const Vector3d up(0.0, 0.0, 200.0);
  vessels_.add(aorta - up, aorta + up, 9.0, 10.0, Tissue::kArtery);
  vessels_.add(cava - up, cava + up, 11.0, 11.0, Tissue::kVein);
  const Vector3d artery = T_torso_kidney_ * kidney_.artery_end_mm();
  const Vector3d vein = T_torso_kidney_ * kidney_.vein_end_mm();
  vessels_.add_curve(
      {artery, 0.5 * (artery + aorta) + Vector3d(0, 3, 4), aorta + Vector3d(0, 0, 8)}, 3.0, 3.2,
      Tissue::kArtery);
  vessels_.add_curve({vein, 0.5 * (vein + cava) + Vector3d(0, -4, 2), cava + Vector3d(0, 0, 4)},
                     5.0, 6.0, Tissue::kVein);
  vessels_.build_raster();
}

void PatientAnatomy::place_bowel(Sequence& random) {
  // The colon lies lateral and in front of the kidney, in sacculations.
  double z = -130.0;
  while (z < 60.0) {
    bowel_.push_back({{random.between(86.0, 98.0), random.between(-36.0, -26.0), z},
                      {20.0, random.between(20.0, 25.0), 18.0},
                      random.between(-0.9, 0.6)});
    z += random.between(24.0, 32.0);
  }
  for (int i = 0; i < 30; ++i)
    bowel_.push_back(
        {{random.between(-90.0, 85.0), random.between(-75.0, -22.0), random.between(-110.0, 30.0)},
         {random.between(11.0, 18.0), random.between(10.0, 15.0), random.between(11.0, 18.0)},
         random.between(-1.6, 0.4)});
}

void PatientAnatomy::place_bubbles(Sequence& random, int count) {
  for (int i = 0; i < count; ++i) {
    const Vector3d p = random.between(0.25, 0.75) * kidney_.surface_point_mm(random.direction());
    balls_.push_back({ct_from_torso(T_torso_kidney_ * p), random.between(0.2, 0.8), Tissue::kGas});
  }
}

}  // namespace usct::phantom
