#include "registration/search/block_matching.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "parallel.h"
#include "registration/motion_about.h"
#include "registration/search/block_sums.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The edge of a cell of the ultrasound. Cells of 4 mm have lost much of what tells places apart.
constexpr double kCellMm = 2.5;
/// The edge where samples lie too far apart to fill smaller cells, and where all orientations are
/// searched, each of which would take several times as long with smaller ones.
constexpr double kCoarseCellMm = 4.0;
constexpr double kLeastFilled = 0.6;
/// A larger field has larger cells, so that it has no more blocks than this.
constexpr double kMostInField = 1000.0;

/// The diagonal of the largest field that is matched: 2^24 of the smallest cells fill a cube of
/// that edge, in which the field may be turned.
constexpr double kMostFieldMm = 256.0 * kCellMm;

/// Blocks are compared at orientations that lie so far from each other at most, and summed at
/// rotations in between that lie so far from each other at most. A block that is turned by half the
/// way to the next orientation lies a cell beside the CT at its corners.
constexpr double kOrientationRad = 40.0 * kDegree;
constexpr double kRotationRad = 10.0 * kDegree;
/// A box of rotation vectors has more parts along each axis only if it reaches most of all turns.
constexpr int kMostParts = 4;
/// Evenly spread orientations are not a lattice: so many times as many as parts would fill.
constexpr double kSpreadDensity = 1.25;
/// Translations farther than this take more time and memory than what they find is worth.
constexpr double kMostMm = 40.0;

/// The best places are searched again around them, at so many rotations along each axis and with
/// translations up to that.
constexpr int kFineRotations = 3;
constexpr double kFineMm = 5.0;

int parts_of(double width, double most) {
  return std::max(1, static_cast<int>(std::ceil(width / most)));
}

/// Rotations by the vectors in the middles of count^3 equal parts of a cube around 0.
std::vector<Matrix3d> middles_of_parts(double half_width, int count) {
  const double width = 2.0 * half_width / count;
  const auto middle = [&](int i) { return -half_width + (i + 0.5) * width; };
  std::vector<Matrix3d> middles;
  for (int x = 0; x < count; ++x)
    for (int y = 0; y < count; ++y)
      for (int z = 0; z < count; ++z)
        middles.push_back(rotation_from_vector({middle(x), middle(y), middle(z)}));
  return middles;
}

/// The parts along each axis of a box of rotation vectors, one for each orientation; none if they
/// are too many.
std::optional<int> parts_of_box(const StartOptions& region) {
  const int parts = parts_of(2.0 * region.rotation_rad, kOrientationRad);
  return parts <= kMostParts ? std::optional(parts) : std::nullopt;
}

/// The width of the part of the region around each orientation.
double width_of_part(const StartOptions& region) {
  const std::optional<int> parts = parts_of_box(region);
  return parts ? 2.0 * region.rotation_rad / *parts : kOrientationRad;
}

/// So many blocks fill the field.
double blocks_of(const BeamUltrasound& us, double cell_mm) {
  const UltrasoundCells cells(us, Isometry3d::Identity(), cell_mm);
  return static_cast<double>(cells.known()) / kBlockCells;
}

double cell_mm_for(const BeamUltrasound& us, const StartOptions& region) {
  const double coarse = blocks_of(us, kCoarseCellMm);
  const double fine = blocks_of(us, kCellMm);
  const double as_many = std::pow(kCoarseCellMm / kCellMm, 3.0) * coarse;
  const bool is_fine = parts_of_box(region) && fine >= kLeastFilled * as_many;
  return is_fine ? kCellMm * std::max(1.0, std::cbrt(fine / kMostInField))
                 : kCoarseCellMm * std::max(1.0, std::cbrt(coarse / kMostInField));
}

/// The orientations of a region, at the initial translation.
std::vector<Isometry3d> orientations_of(const StartOptions& region,
                                        const Isometry3d& T_us_ct_initial,
                                        const FieldPoints& field) {
  std::vector<Isometry3d> orientations;
  if (const std::optional<int> parts = parts_of_box(region)) {
    for (const Matrix3d& turn : middles_of_parts(region.rotation_rad, *parts))
      orientations.push_back(motion_about(field.centre_us_mm(), turn) * T_us_ct_initial);
    return orientations;
  }
  // Turns by up to an angle a fill 8 pi (a - sin a) of the rotation group, where small turns have
  // the volume of their rotation vectors.
  const double volume = 8.0 * kPi * (region.rotation_rad - std::sin(region.rotation_rad));
  StartOptions spread{StartRegion::kBall, 0, region.rotation_rad, 0.0};
  spread.count = static_cast<int>(kSpreadDensity * volume / std::pow(kOrientationRad, 3.0));
  const PoseParameters pose(T_us_ct_initial, field.us_mm());
  for (const PoseVector& start : spread_starts(pose, spread))
    orientations.push_back(pose.T_us_ct(start));
  return orientations;
}

/// The best places of blocks near each of these poses, so many of each.
std::vector<Candidate> best_places(const BlockSums& sums, const PackedCt& ct,
                                   const std::vector<Isometry3d>& T_us_ct, std::size_t most_of_each,
                                   Run& run) {
  std::vector<std::vector<Candidate>> found(T_us_ct.size());
  parallel_for(static_cast<int>(T_us_ct.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    for (const BlockPlace& place : sums.best(ct, T_us_ct[at])) {
      if (found[at].size() == most_of_each) break;
      found[at].push_back(
          {sums.T_us_ct_at(place, T_us_ct[at]), {}, static_cast<double>(place.explained), 0.0});
    }
  });
  std::vector<Candidate> all;
  for (const std::vector<Candidate>& of_pose : found)
    all.insert(all.end(), of_pose.begin(), of_pose.end());
  return all;
}

}  // namespace

BlockMatching::BlockMatching(std::shared_ptr<const BeamUltrasound> us,
                             std::shared_ptr<const PackedCt> ct, const StartOptions& region)
    : us_(std::move(us)),
      ct_(std::move(ct)),
      region_(region),
      cell_mm_(cell_mm_for(*us_, region_)) {}

bool BlockMatching::covers(const StartOptions& region) {
  return region.translation_mm <= kMostMm &&
         (parts_of_box(region) || region.region == StartRegion::kBall);
}

bool BlockMatching::covers(const BeamUltrasound& us) { return diagonal_mm(us) <= kMostFieldMm; }

std::vector<Candidate> BlockMatching::poses(const Isometry3d& T_us_ct_initial,
                                            const Isometry3d& mirror, const FieldPoints& field,
                                            double distinct_mm, std::size_t most, Run& run) const {
  const UltrasoundCells cells(*us_, mirror, cell_mm_);
  const std::vector<UltrasoundBlock> blocks = cells.blocks();
  if (blocks.empty()) return {};
  const double width = width_of_part(region_);
  const int rotations = parts_of(width, kRotationRad);
  const BlockSums coarse(cells, blocks, BlockSums::Everywhere::kPart,
                         middles_of_parts(0.5 * width, rotations), region_.translation_mm,
                         field.centre_us_mm());
  const std::vector<Isometry3d> orientations = orientations_of(region_, T_us_ct_initial, field);
  std::vector<Candidate> places =
      best_places(coarse, *ct_, orientations, std::numeric_limits<std::size_t>::max(), run);
  const std::size_t refined = std::max(most, orientations.size());
  places = best_distinct(std::move(places), distinct_mm, refined, field);
  const BlockSums fine(cells, blocks, BlockSums::Everywhere::kAll,
                       middles_of_parts(0.5 * width / rotations, kFineRotations), kFineMm,
                       field.centre_us_mm());
  std::vector<Isometry3d> near;
  for (const Candidate& place : places) near.push_back(place.T_us_ct);
  return best_distinct(best_places(fine, *ct_, near, 1, run), distinct_mm, most, field);
}

}  // namespace usct::registration
