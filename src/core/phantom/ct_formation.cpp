#include "us_ct_registration/phantom/ct_formation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel.h"
#include "phantom/check.h"
#include "phantom/gaussian.h"
#include "random.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/volume/operations.h"

namespace usct::phantom {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Points per axis and voxel at which the tissue is taken; more near a ball, whose centroid in the
// image serves as a landmark.
constexpr int kSupersampling = 3;
constexpr int kSupersamplingOfBalls = 10;

/// Patient axis (0, 1, 2) and sense of a letter of `CtOptions::axes`.
std::pair<int, double> axis_of_letter(char letter) {
  switch (letter) {
    case 'L':
      return {0, 1.0};
    case 'R':
      return {0, -1.0};
    case 'P':
      return {1, 1.0};
    case 'A':
      return {1, -1.0};
    case 'S':
      return {2, 1.0};
    case 'I':
      return {2, -1.0};
    default:
      return {-1, 0.0};
  }
}

const Ball* ball_at(const std::vector<Ball>& balls, const Vector3d& p_mm) {
  for (const Ball& ball : balls)
    if ((p_mm - ball.centre_ct_mm).squaredNorm() < ball.radius_mm * ball.radius_mm) return &ball;
  return nullptr;
}

/// Marks the voxels that may hold a part of a ball.
std::vector<bool> voxels_near_balls(const std::vector<Ball>& balls, const Grid& grid) {
  std::vector<bool> near(grid.voxel_count(), false);
  for (const Ball& ball : balls) {
    const Region region = region_around(grid, {ball.centre_ct_mm}, ball.radius_mm + 1.0);
    for (int k = 0; k < region.size.z(); ++k)
      for (int j = 0; j < region.size.y(); ++j)
        for (int i = 0; i < region.size.x(); ++i)
          near[grid.offset(region.begin.x() + i, region.begin.y() + j, region.begin.z() + k)] =
              true;
  }
  return near;
}

bool all_neighbours_alike(const LabelVolume& labels, int i, int j, int k) {
  const std::uint16_t label = labels.at(i, j, k);
  const Vector3i& size = labels.grid.size;
  for (int c = std::max(0, k - 1); c <= std::min(size.z() - 1, k + 1); ++c)
    for (int b = std::max(0, j - 1); b <= std::min(size.y() - 1, j + 1); ++b)
      for (int a = std::max(0, i - 1); a <= std::min(size.x() - 1, i + 1); ++a)
        if (labels.at(a, b, c) != label) return false;
  return true;
}

/// Mean HU over the voxel around `index`; `texture_hu` belongs to the tissue `own` of its centre.
float partial_volume_hu(const Anatomy& anatomy, const TissueTable& tissues, const Grid& grid,
                        const Vector3d& index, bool near_ball, Tissue own, double texture_hu) {
  const int per_axis = near_ball ? kSupersamplingOfBalls : kSupersampling;
  double sum = 0.0;
  for (int c = 0; c < per_axis; ++c)
    for (int b = 0; b < per_axis; ++b)
      for (int a = 0; a < per_axis; ++a) {
        const Vector3d shift = (Vector3d(a, b, c).array() + 0.5) / per_axis - 0.5;
        const Vector3d p = grid.physical_from_index(index + shift);
        const Ball* ball = near_ball ? ball_at(anatomy.balls(), p) : nullptr;
        const Tissue tissue = ball ? ball->tissue : anatomy.tissue(p);
        sum += tissues[tissue].hu + (tissue == own ? texture_hu : 0.0);
      }
  return static_cast<float>(sum / (per_axis * per_axis * per_axis));
}

Volume<float> mean_hu(const Anatomy& anatomy, const TissueTable& tissues, const LabelVolume& labels,
                      std::uint64_t seed, const Progress& progress) {
  const Grid& grid = labels.grid;
  const std::vector<bool> near_balls = voxels_near_balls(anatomy.balls(), grid);
  Volume<float> hu(grid);
  const auto slice = [&](int k) {
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const auto own = static_cast<Tissue>(labels.at(i, j, k));
        const Vector3d index(i, j, k);
        const Vector3d p = grid.physical_from_index(index);
        const TissueProperties& properties = tissues[own];
        const double texture_hu =
            properties.hu_texture == 0.0
                ? 0.0
                : properties.hu_texture * texture_at(anatomy, properties, own, p, seed);
        const bool near_ball = near_balls[grid.offset(i, j, k)];
        hu.at(i, j, k) =
            !near_ball && all_neighbours_alike(labels, i, j, k)
                ? static_cast<float>(properties.hu + texture_hu)
                : partial_volume_hu(anatomy, tissues, grid, index, near_ball, own, texture_hu);
      }
  };
  parallel_for(grid.size.z(), slice, progress);
  return hu;
}

/// Standard deviation of the point spread along each index axis.
Vector3d spread_sigma_mm(const Grid& grid, const CtOptions& options) {
  const Vector3d sigma =
      Vector3d(options.in_plane_fwhm_mm, options.in_plane_fwhm_mm, options.slice_fwhm_mm) /
      kFwhmPerSigma;
  return (grid.direction.transpose().cwiseAbs2() * sigma.cwiseAbs2()).cwiseSqrt();
}

/// Noise of standard deviation 1 whose spectrum rises from near zero and falls again.
Volume<float> band_pass_noise(const Grid& grid, std::uint64_t seed) {
  Volume<float> white(grid);
  parallel_for(grid.size.z(), [&](int k) {
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        white.at(i, j, k) = static_cast<float>(normal(hash(seed, i, j, k)));
  });
  Volume<float> fine = smooth_gaussian(white, 0.75 * grid.spacing_mm, whole(grid));
  const Volume<float> coarse = smooth_gaussian(white, 2.2 * grid.spacing_mm, whole(grid));
  double squares = 0.0;
  for (std::size_t i = 0; i < fine.voxels.size(); ++i) {
    fine.voxels[i] -= 0.8F * coarse.voxels[i];
    squares += static_cast<double>(fine.voxels[i]) * fine.voxels[i];
  }
  const auto scale =
      static_cast<float>(1.0 / std::sqrt(squares / static_cast<double>(fine.voxels.size())));
  for (float& v : fine.voxels) v *= scale;
  return fine;
}

std::int16_t whole_hu(float hu) {
  return static_cast<std::int16_t>(std::nearbyint(std::clamp(hu, -1024.0F, 3071.0F)));
}

}  // namespace

void CtOptions::validate() const {
  const std::array<std::string, 3> names = {"[0]", "[1]", "[2]"};
  for (int a = 0; a < 3; ++a) {
    const std::string& name = names[static_cast<std::size_t>(a)];
    require_range("ct.size" + name, size[a], 2, 4096);
    require_range("ct.spacing_mm" + name, spacing_mm[a], 0.05, 20.0);
    require_range("ct.oblique_deg" + name, oblique_deg[a], -180.0, 180.0);
  }
  require_range("ct.noise_hu", noise_hu, 0.0, 200.0);
  require_range("ct.in_plane_fwhm_mm", in_plane_fwhm_mm, 0.0, 5.0);
  require_range("ct.slice_fwhm_mm", slice_fwhm_mm, 0.0, 5.0);
  int seen = 0;
  for (const char letter : axes)
    if (const int axis = axis_of_letter(letter).first; axis >= 0) seen |= 1 << axis;
  if (axes.size() != 3 || seen != 7)
    throw InputError("phantom options",
                     "'ct.axes' is '" + axes + "', must hold one each of L or R, P or A, S or I");
}

Grid ct_grid(const CtOptions& options, const Vector3d& centre_mm) {
  Grid grid;
  grid.direction.setZero();
  for (int a = 0; a < 3; ++a) {
    const auto [axis, sense] = axis_of_letter(options.axes[static_cast<std::size_t>(a)]);
    grid.size[a] = options.size[axis];
    grid.spacing_mm[a] = options.spacing_mm[axis];
    grid.direction(axis, a) = sense;
  }
  const Vector3d turn = kDegree * options.oblique_deg;
  grid.direction = (Eigen::AngleAxisd(turn.z(), Vector3d::UnitZ()) *
                    Eigen::AngleAxisd(turn.y(), Vector3d::UnitY()) *
                    Eigen::AngleAxisd(turn.x(), Vector3d::UnitX()))
                       .toRotationMatrix() *
                   grid.direction;
  grid.origin_mm.setZero();
  grid.origin_mm = centre_mm - grid.centre_mm();
  return grid;
}

CtVolume form_ct(const Anatomy& anatomy, const TissueTable& tissues, const LabelVolume& labels,
                 const CtOptions& options, std::uint64_t seed, const Progress& progress) {
  options.validate();
  const Grid& grid = labels.grid;
  const Volume<float> hu = mean_hu(anatomy, tissues, labels, seed, progress);
  const Volume<float> blurred = smooth_gaussian(hu, spread_sigma_mm(grid, options), whole(grid));
  Volume<float> noise;
  if (options.noise_hu > 0.0) noise = band_pass_noise(grid, hash(seed, 0xC7));
  CtVolume ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i) {
    const float added =
        noise.voxels.empty() ? 0.0F : static_cast<float>(options.noise_hu) * noise.voxels[i];
    ct.voxels[i] = whole_hu(blurred.voxels[i] + added);
  }
  return ct;
}

LabelVolume form_labels(const Anatomy& anatomy, const Grid& grid, const Progress& progress) {
  LabelVolume labels(grid);
  parallel_for(
      grid.size.z(),
      [&](int k) {
        for (int j = 0; j < grid.size.y(); ++j)
          for (int i = 0; i < grid.size.x(); ++i)
            labels.at(i, j, k) = static_cast<std::uint16_t>(
                anatomy.tissue(grid.physical_from_index(Vector3d(i, j, k))));
      },
      progress);
  return labels;
}

void add_ct_noise(CtVolume& ct, double noise_hu, std::uint64_t seed) {
  if (noise_hu <= 0.0) return;
  const Volume<float> noise = band_pass_noise(ct.grid, hash(seed, 0xC7));
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)
    ct.voxels[i] =
        whole_hu(static_cast<float>(ct.voxels[i]) + static_cast<float>(noise_hu) * noise.voxels[i]);
}

}  // namespace usct::phantom
