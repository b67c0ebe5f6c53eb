#include "phantom/kidney.h"

#include <algorithm>
#include <cmath>

#include "random.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;

// Middle of the sinus, in normalised coordinates: nearer to the hilum.
const Vector3d kSinusCentre(0.0, -0.28, 0.0);

double legendre(int order, double t) {
  return order == 3 ? 0.5 * (5.0 * t * t * t - 3.0 * t)
                    : 0.125 * (35.0 * t * t * t * t - 30.0 * t * t + 3.0);
}

Vector3d between(const Vector3d& a, const Vector3d& b, double t) {
  return (a + t * (b - a)).normalized();
}

}  // namespace

Kidney::Kidney(std::uint64_t seed, const KidneyContent& content) {
  Sequence random(seed, 0x41D);
  half_axes_ = {random.between(50.0, 58.0), random.between(26.5, 30.5), random.between(20.5, 24.5)};
  bend_mm_ = random.between(4.0, 8.0);
  hilum_depth_ = random.between(0.35, 0.55);
  cortex_mm_ = random.between(6.0, 8.0);
  sinus_axes_ = {random.between(0.52, 0.62), random.between(0.46, 0.54),
                 random.between(0.34, 0.42)};
  for (int i = 0; i < 7; ++i)
    bumps_.push_back({random.direction(), random.gaussian(0.0, 0.028), 3 + i % 2});
  place_pyramids(seed);
  grow_collecting_system(seed, content);
  grow_vessels(seed, content);
  tubes_.build_raster();
  place_lesions(seed, content);
}

Kidney::Normalised Kidney::normalise(const Vector3d& p_mm) const {
  const double along = p_mm.x() / half_axes_.x();
  const Vector3d straight(p_mm.x(), p_mm.y() + bend_mm_ * along * along, p_mm.z());
  Normalised n;
  n.u = straight.cwiseQuotient(half_axes_);
  n.length = std::max(1e-9, n.u.norm());
  n.rho = n.length;
  n.radius_mm = p_mm.norm() / n.rho;
  if (n.length > 1.8) return n;
  const Vector3d unit = n.u / n.length;
  double factor = 1.0;
  for (const Bump& bump : bumps_)
    factor -= bump.amplitude * legendre(bump.order, bump.direction.dot(unit));
  if (unit.y() < 0.0) {
    const double x = unit.x() / 0.42;
    const double z = unit.z() / 0.45;
    factor += hilum_depth_ * unit.y() * unit.y() * std::exp(-0.5 * (x * x + z * z));
  }
  n.rho *= factor;
  n.radius_mm /= factor;
  return n;
}

double Kidney::radial(const Vector3d& p_mm) const { return normalise(p_mm).rho; }

Vector3d Kidney::point_at(const Vector3d& unit_u, double rho) const {
  // rho is proportional to |u| along a direction of u.
  const auto unbent = [&](double length) -> Vector3d {
    Vector3d p = (length * unit_u).cwiseProduct(half_axes_);
    const double along = p.x() / half_axes_.x();
    p.y() -= bend_mm_ * along * along;
    return p;
  };
  return unbent(rho / normalise(unbent(1.0)).rho);
}

/// The point along a direction of u, from the sinus' wall (t = 0) to the pyramids' bases (t = 1).
Vector3d Kidney::point_between(const Vector3d& unit_u, double t) const {
  const Vector3d surface = point_at(unit_u, 1.0);
  const double base = pyramid_base(normalise(surface));
  const double wall = sinus_wall(unit_u) / normalise(surface).length;
  return point_at(unit_u, wall + t * (base - wall));
}

Vector3d Kidney::surface_point_mm(const Vector3d& direction) const {
  double inside = 0.0;
  double outside = 1.5 * half_axes_.maxCoeff();
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (inside + outside);
    (radial(middle * direction) < 1.0 ? inside : outside) = middle;
  }
  return inside * direction;
}

double Kidney::sinus_wall(const Vector3d& unit_u) const {
  // The point at which a ray from the origin leaves the sinus' ellipsoid, which holds the origin.
  const Vector3d v = unit_u.cwiseQuotient(sinus_axes_);
  const Vector3d c = -kSinusCentre.cwiseQuotient(sinus_axes_);
  const double a = v.squaredNorm();
  const double b = v.dot(c);
  return (-b + std::sqrt(b * b + a * (1.0 - c.squaredNorm()))) / a;
}

double Kidney::pyramid_base(const Normalised& n) const {
  return std::max(0.5, 1.0 - cortex_mm_ / n.radius_mm);
}

Tissue Kidney::parenchyma_or_sinus(const Normalised& n) const {
  const double base = pyramid_base(n);
  if (n.rho > base) return Tissue::kCortex;
  const Vector3d unit = n.u / n.length;
  double cosine = -1.0;
  for (const Vector3d& axis : pyramids_) cosine = std::max(cosine, axis.dot(unit));
  const double off_axis = std::sqrt(2.0 * std::max(0.0, 1.0 - cosine)) / pyramid_angle_rad_;
  // Papillae protrude into the sinus; between them its fat extends further out.
  const double wall =
      sinus_wall(unit) * n.rho / n.length * (1.1 - 0.28 * std::exp(-4.0 * off_axis * off_axis));
  if (n.rho < wall) return Tissue::kSinusFat;
  // A pyramid is a cone with a domed base.
  const double t = (n.rho - wall) / std::max(0.05, base - wall);
  const bool pyramid = off_axis < 0.38 + 0.62 * t && t < 1.0 - 0.22 * off_axis * off_axis;
  return pyramid ? Tissue::kMedulla : Tissue::kCortex;
}

std::optional<Tissue> Kidney::lesion_at(const Vector3d& p_mm) const {
  for (const Lesion& lesion : lesions_) {
    const Vector3d offset = p_mm - lesion.centre;
    const double distance = offset.norm();
    if (distance > 1.25 * lesion.radius) continue;
    const double bump = 1.0 + 0.06 * smooth_noise(lesion.seed, 2.0 / lesion.radius * offset);
    if (distance < lesion.radius * bump) return lesion.tissue;
  }
  return std::nullopt;
}

std::optional<Tissue> Kidney::tissue(const Vector3d& p_mm) const {
  if (const auto lesion = lesion_at(p_mm)) return lesion;
  const Normalised n = normalise(p_mm);
  if (const auto tube = tubes_.find(p_mm)) return tube->tissue;
  if (n.rho >= 1.0) return std::nullopt;
  return parenchyma_or_sinus(n);
}

void Kidney::place_pyramids(std::uint64_t seed) {
  Sequence random(seed, 0x9142);
  const int count = 8 + static_cast<int>(random.next() % 7);
  // Each next pyramid is the one of many random directions that is furthest from all others and
  // from the hilum.
  while (static_cast<int>(pyramids_.size()) < count) {
    Vector3d best = Vector3d::UnitY();
    double best_cosine = 2.0;
    for (int trial = 0; trial < 40; ++trial) {
      const Vector3d candidate = random.direction();
      double cosine = -candidate.y() > 0.55 ? 1.5 : -1.0;
      for (const Vector3d& other : pyramids_) cosine = std::max(cosine, candidate.dot(other));
      if (cosine < best_cosine) {
        best_cosine = cosine;
        best = candidate;
      }
    }
    pyramids_.push_back(best);
  }
  pyramid_angle_rad_ = 0.84 * std::sqrt(4.0 * 0.8 / count);
}

void Kidney::grow_collecting_system(std::uint64_t seed, const KidneyContent& content) {
  Sequence random(seed, 0xCA1);
  const double scale = content.calyx_scale;
  const Vector3d pelvis(random.gaussian(0.0, 2.0), -0.62 * half_axes_.y(),
                        random.gaussian(1.5, 1.0));
  const Vector3d leaving(pelvis.x() - 6.0, -half_axes_.y() - 4.0, pelvis.z() + 2.0);
  const Vector3d ureter_end(-content.pedicle_mm - 20.0, -half_axes_.y() - 8.0, pelvis.z() + 3.0);
  tubes_.add_curve({pelvis, leaving, ureter_end}, 3.6 * scale, 1.4 * scale, Tissue::kUrine);
  for (const Vector3d& pyramid : pyramids_) {
    const Vector3d calyx = point_between(pyramid, -0.18);
    const Vector3d middle = 0.55 * calyx + 0.45 * pelvis;
    tubes_.add_curve({calyx, middle, pelvis}, 1.3 * scale, 1.8 * scale, Tissue::kUrine);
    tubes_.add(calyx, 1.02 * calyx, 2.3 * scale, 1.6 * scale, Tissue::kUrine);
  }
}

void Kidney::grow_vessels(std::uint64_t seed, const KidneyContent& content) {
  Sequence random(seed, 0xA27);
  const double y_hilum = -0.75 * half_axes_.y();
  const double y_end = -half_axes_.y() - content.pedicle_mm;
  artery_end_ = {random.gaussian(4.0, 2.0), y_end, random.gaussian(-3.0, 1.0)};
  vein_end_ = {random.gaussian(-1.0, 2.0), y_end, random.gaussian(4.0, 1.0)};
  const Vector3d artery_hilum(random.gaussian(3.0, 2.0), y_hilum, -4.0);
  const Vector3d vein_hilum(random.gaussian(-2.0, 2.0), y_hilum, 5.5);
  tubes_.add_curve(
      {artery_end_, 0.5 * (artery_end_ + artery_hilum) + Vector3d(2.0, 0.0, 1.5), artery_hilum},
      3.0, 2.5, Tissue::kArtery);
  tubes_.add_curve(
      {vein_end_, 0.5 * (vein_end_ + vein_hilum) + Vector3d(-2.0, 0.0, 1.0), vein_hilum}, 5.0, 4.2,
      Tissue::kVein);
  for (std::size_t i = 0; i < pyramids_.size(); ++i) {
    // Interlobar vessels run in the column between this pyramid and its nearest neighbour, then
    // arcuate ones over both bases.
    std::size_t nearest = i == 0 ? 1 : 0;
    for (std::size_t j = 0; j < pyramids_.size(); ++j)
      if (j != i && pyramids_[i].dot(pyramids_[j]) > pyramids_[i].dot(pyramids_[nearest]))
        nearest = j;
    const Vector3d& own = pyramids_[i];
    const Vector3d& other = pyramids_[nearest];
    const Vector3d column = (between(own, other, 0.5) + 0.12 * random.direction()).normalized();
    const Vector3d vein_column = (column + 0.10 * random.direction()).normalized();
    const Vector3d root = point_between(column, -0.1);
    const Vector3d top = point_between(column, 0.97);
    tubes_.add_curve({artery_hilum, 0.5 * (artery_hilum + root) + 2.0 * random.direction(), root,
                      point_between(column, 0.5), top},
                     2.0, 0.8, Tissue::kArtery);
    tubes_.add_curve({vein_hilum, 0.5 * (vein_hilum + root) + 3.0 * random.direction(),
                      point_between(vein_column, 0.0), point_between(vein_column, 0.5),
                      point_between(vein_column, 0.95)},
                     2.6, 1.0, Tissue::kVein);
    for (const Vector3d& towards : {own, other})
      tubes_.add_curve({top, point_between(between(column, towards, 0.45), 1.02),
                        point_between(between(column, towards, 0.9), 1.04)},
                       0.8, 0.45, Tissue::kArtery);
  }
}

void Kidney::place_lesions(std::uint64_t seed, const KidneyContent& content) {
  Sequence random(seed, 0x1E5);
  const auto lateral_direction = [&] {
    Vector3d d = random.direction();
    d.y() = std::abs(d.y());
    d.x() *= 0.7;
    return d.normalized();
  };
  const Vector3d tumour = lateral_direction();
  Vector3d cyst = lateral_direction();
  if (cyst.dot(tumour) > 0.2) cyst = (cyst - 1.6 * cyst.dot(tumour) * tumour).normalized();
  const double tumour_radius = random.between(9.0, 15.0);
  const double cyst_radius = random.between(6.0, 12.0);
  const auto& papilla = pyramids_[random.next() % pyramids_.size()];
  const double stone_radius = random.between(2.0, 4.0);
  if (content.stone)
    lesions_.push_back(
        {point_between(papilla, -0.22), stone_radius, Tissue::kStone, random.next()});
  if (content.tumour)
    lesions_.push_back({point_at(tumour, 1.0) * (1.0 - 0.15 * tumour_radius / 30.0), tumour_radius,
                        Tissue::kTumour, random.next()});
  if (content.cyst)
    lesions_.push_back({point_at(cyst, 0.92), cyst_radius, Tissue::kCyst, random.next()});
}

}  // namespace usct::phantom
