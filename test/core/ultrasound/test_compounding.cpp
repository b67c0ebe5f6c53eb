#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>

#include "core/geometry/random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/compounding.h"
#include "with_threads.h"

namespace usct {
namespace {

using test::integer;
using test::random_pose;
using test::uniform;

Grid grid_of(const Eigen::Vector3i& size, const Eigen::Vector3d& origin_mm, double spacing_mm) {
  Grid grid;
  grid.size = size;
  grid.origin_mm = origin_mm;
  grid.spacing_mm.setConstant(spacing_mm);
  return grid;
}

/// Images with one brightness each, 21 x 11 pixels of 1 mm, in planes of constant z.
TrackedImages flat_images(const std::vector<std::pair<double, std::uint8_t>>& z_and_brightness) {
  TrackedImages images;
  images.width = 21;
  images.height = 11;
  for (const auto& [z, brightness] : z_and_brightness) {
    images.pixels.insert(images.pixels.end(), 21 * 11, brightness);
    Eigen::Affine3d T = Eigen::Affine3d::Identity();
    T.translation().z() = z;
    images.T_us_pixel.push_back(T);
  }
  return images;
}

/// The voxel values of `images` compounded in a column along z at x = 10, y = 5, from 0 in steps of
/// 1 mm; -1 for unknown voxels.
std::vector<int> column(const TrackedImages& images, int size, const CompoundOptions& options) {
  const Grid grid = grid_of({3, 3, size}, {9.0, 4.0, 0.0}, 1.0);
  const ScanConverted result = compound(images, grid, options);
  std::vector<int> values;
  for (int k = 0; k < size; ++k)
    values.push_back(result.mask.at(1, 1, k) == 0 ? -1 : result.volume.at(1, 1, k));
  return values;
}

TEST(Compound, CombinesFramesInAVoxelAsAsked) {
  const TrackedImages images = flat_images({{1.0, 50}, {1.0, 80}, {1.5, 20}});
  CompoundOptions options;
  options.slice_thickness_mm = 2.0;
  // At z = 1: weights 1, 1 and 0.5. At z = 2: the third alone, 0.5 mm away (the others touch it
  // with weight 0). At z = 0: no image.
  options.compounding = Compounding::kMean;
  EXPECT_EQ(column(images, 3, options), (std::vector<int>{-1, 56, 20}));
  options.compounding = Compounding::kMaximum;
  EXPECT_EQ(column(images, 3, options), (std::vector<int>{-1, 80, 20}));
  options.compounding = Compounding::kLatest;
  EXPECT_EQ(column(images, 3, options), (std::vector<int>{-1, 20, 20}));
}

TEST(Compound, ReachesHalfTheSliceThicknessAndNoFarther) {
  const TrackedImages images = flat_images({{5.0, 100}});
  CompoundOptions options;
  options.slice_thickness_mm = 4.1;
  EXPECT_EQ(column(images, 10, options),
            (std::vector<int>{-1, -1, -1, 100, 100, 100, 100, 100, -1, -1}));
  options.slice_thickness_mm = 0.5;
  EXPECT_EQ(column(images, 10, options),
            (std::vector<int>{-1, -1, -1, -1, -1, 100, -1, -1, -1, -1}));
}

TEST(Compound, BridgesGapsBetweenFramesButDoesNotGrowOutwards) {
  const TrackedImages images = flat_images({{2.0, 40}, {6.0, 80}, {12.0, 80}});
  CompoundOptions options;
  options.slice_thickness_mm = 0.5;
  options.hole_fill_radius_mm = 3.5;  // bridges 4 mm (3 on either side of z = 3), not 6 mm at z = 9
  const std::vector<int> filled = column(images, 15, options);
  EXPECT_EQ(filled[2], 40);
  EXPECT_EQ(filled[3], 50);  // linear across the gap
  EXPECT_EQ(filled[4], 60);
  EXPECT_EQ(filled[5], 70);
  EXPECT_EQ(filled[6], 80);
  EXPECT_EQ(filled[0], -1);
  EXPECT_EQ(filled[1], -1);
  EXPECT_EQ(filled[13], -1);
  EXPECT_EQ(filled[9], 80);  // 3 mm from either side
  options.hole_fill_radius_mm = 2.5;
  EXPECT_EQ(column(images, 15, options)[9], -1);
  options.hole_fill_radius_mm = 0.0;
  EXPECT_EQ(column(images, 15, options)[4], -1);
  options.hole_fill_radius_mm = 1e12;  // more voxels than an int can count
  EXPECT_EQ(column(images, 15, options)[4], 60);
}

/// An affine function of position, in [0, 255] within 100 mm.
struct AffineBrightness {
  Eigen::Vector3d gradient = 0.6 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  double operator()(const Eigen::Vector3d& p) const { return 127.0 + gradient.dot(p); }
};

/// An image in any plane, with pixels that are neither square nor quite orthogonal.
Eigen::Affine3d random_calibration() {
  Eigen::Affine3d T(random_pose(20.0));
  Eigen::Matrix3d pixel = Eigen::Matrix3d::Identity();
  pixel(0, 0) = uniform(0.3, 1.0);
  pixel(1, 1) = uniform(0.3, 1.0);
  pixel(0, 1) = uniform(-0.05, 0.05);
  pixel.col(2) << uniform(-9, 9), uniform(-9, 9), uniform(-9, 9);  // not to be used
  T.linear() = T.linear() * pixel;
  return T;
}

RC_GTEST_PROP(Compound, ImagesInAnyPlaneLandWhereTheirPosePutsThem, ()) {
  const AffineBrightness brightness;
  TrackedImages images;
  images.width = 40;
  images.height = 30;
  for (int n = 0; n < 4; ++n) {
    images.T_us_pixel.push_back(random_calibration());
    for (int row = 0; row < images.height; ++row)
      for (int col = 0; col < images.width; ++col)
        images.pixels.push_back(static_cast<std::uint8_t>(
            std::lround(brightness(images.T_us_pixel.back() * Eigen::Vector3d(col, row, 0.0)))));
  }
  CompoundOptions options;
  options.slice_thickness_mm = uniform(0.5, 3.0);
  options.compounding = integer(0, 2) == 0 ? Compounding::kMean : Compounding::kLatest;
  Grid grid = test::random_grid(30);
  const Eigen::Vector3d middle = images.T_us_pixel[0] * Eigen::Vector3d(20.0, 15.0, 0.0);
  grid.origin_mm += middle - grid.centre_mm();
  const ScanConverted result = compound(images, grid, options);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d p = grid.physical_from_index(Eigen::Vector3d(i, j, k));
        // The truth, plane by plane: nearest point in the plane and distance from it.
        bool surely_known = false;
        bool maybe_known = false;
        for (const Eigen::Affine3d& T : images.T_us_pixel) {
          const Eigen::Matrix<double, 3, 2> columns = T.linear().leftCols<2>();
          const Eigen::Vector2d pixel = columns.colPivHouseholderQr().solve(p - T.translation());
          const double distance = (p - T.translation() - columns * pixel).norm();
          const auto within = [&](double margin) {
            return distance < 0.5 * options.slice_thickness_mm + margin && pixel.x() > -margin &&
                   pixel.x() < images.width - 1 + margin && pixel.y() > -margin &&
                   pixel.y() < images.height - 1 + margin;
          };
          surely_known |= within(-1e-6);
          maybe_known |= within(1e-6);
        }
        if (surely_known) RC_ASSERT(result.mask.at(i, j, k) == 255);
        if (!maybe_known) RC_ASSERT(result.mask.at(i, j, k) == 0);
        // Pixel and voxel rounding, and the distance from the planes.
        if (result.mask.at(i, j, k) != 0)
          RC_ASSERT(std::abs(result.volume.at(i, j, k) - brightness(p)) <
                    1.01 + 0.5 * options.slice_thickness_mm * brightness.gradient.norm());
      }
}

/// A tracked sweep whose voxels are a function of position.
PreScanVolume tracked_recording(const Array& array, const std::vector<Eigen::Isometry3d>& poses,
                                const std::function<double(const Eigen::Vector3d&)>& brightness) {
  PreScanVolume prescan{{{80, 1.0, 0.5}, array, TrackedSweep{poses, {}}}, {}, {}};
  for (int frame = 0; frame < prescan.geometry.frames(); ++frame)
    for (int line = 0; line < prescan.geometry.lines(); ++line)
      for (int sample = 0; sample < prescan.geometry.samples(); ++sample)
        prescan.voxels.push_back(static_cast<std::uint8_t>(std::lround(brightness(
            us_from_scan(prescan.geometry, {static_cast<double>(sample), static_cast<double>(line),
                                            static_cast<double>(frame)})))));
  return prescan;
}

RC_GTEST_PROP(Compound, ATrackedFanLandsWhereItsPosePutsIt, ()) {
  const AffineBrightness brightness;
  const CurvilinearArray array{30.0, test::uneven_table(60, -35.0 * kDegree, 30.0 * kDegree)};
  const Eigen::Isometry3d pose = random_pose(20.0);
  const PreScanVolume prescan = tracked_recording(array, {pose}, brightness);
  CompoundOptions options;
  options.slice_thickness_mm = 2.0;
  const Grid grid = fan_grid(prescan.geometry, 2.5);
  const ScanConverted result = compound(prescan, grid, options);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d p = grid.physical_from_index(Eigen::Vector3d(i, j, k));
        const Eigen::Vector3d p_frame = pose.inverse() * p;
        const double depth = p_frame.head<2>().norm() - 30.0;
        const double angle = std::atan2(p_frame.x(), p_frame.y()) / kDegree;
        // Half a step beyond the outermost lines is in (at most 10 times the mean step of 1.1).
        const bool surely = std::abs(p_frame.z()) < 0.999 && depth > 0.76 && depth < 40.74 &&
                            angle > -35.0 && angle < 30.0;
        const bool maybe = std::abs(p_frame.z()) < 1.001 && depth > 0.74 && depth < 40.76 &&
                           angle > -37.0 && angle < 32.0;
        if (surely) RC_ASSERT(result.mask.at(i, j, k) == 255);
        if (!maybe) RC_ASSERT(result.mask.at(i, j, k) == 0);
        if (surely)
          RC_ASSERT(std::abs(result.volume.at(i, j, k) - brightness(p)) <
                    1.3 + brightness.gradient.norm() * (1.0 + 0.25));  // depth repeats at the edges
      }
}

// A linear array's frame is an image whose columns are lines: both functions give the same volume.
TEST(Compound, ALinearSweepIsTheSameAsItsImages) {
  std::vector<Eigen::Isometry3d> poses;
  for (int n = 0; n < 12; ++n) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(0.04 * n, Eigen::Vector3d(1, 0.3, 0).normalized()).matrix();
    T.translation().z() = 0.9 * n;
    poses.push_back(T);
  }
  const PreScanVolume prescan =
      tracked_recording(LinearArray{centred_table(50, 0.6)}, poses,
                        [](const Eigen::Vector3d& p) { return 120.0 + 90.0 * std::sin(p.sum()); });
  TrackedImages images;  // columns are samples, as the recording stores them; rows are lines
  images.width = 80;
  images.height = 50;
  images.pixels = prescan.voxels;
  for (const Eigen::Isometry3d& pose : poses) {
    Eigen::Affine3d T_frame_pixel = Eigen::Affine3d::Identity();
    T_frame_pixel.matrix().topRows<3>() << 0, 0.6, 0, -0.6 * 24.5, 0.5, 0, 0, 1.0, 0, 0, 1, 0;
    images.T_us_pixel.push_back(pose * T_frame_pixel);
  }
  const Grid grid = fan_grid(prescan.geometry, 0.7);
  CompoundOptions options;
  options.average_in_plane = false;  // else the edges differ by half a pixel
  const ScanConverted sweep = compound(prescan, grid, options);
  const ScanConverted pictures = compound(images, grid, options);
  std::size_t both = 0;
  for (std::size_t n = 0; n < grid.voxel_count(); ++n) {
    if (pictures.mask.voxels[n] == 0) continue;
    EXPECT_EQ(sweep.mask.voxels[n], 255);
  }
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 3; j < grid.size.y() - 3; ++j)
      for (int i = 3; i < grid.size.x() - 3; ++i)
        if (pictures.mask.at(i, j, k) != 0) {
          ++both;
          EXPECT_NEAR(sweep.volume.at(i, j, k), pictures.volume.at(i, j, k), 1.0);
        }
  EXPECT_GT(both, 5000U);
}

// Speckle finer than the voxels is averaged, not picked at random.
TEST(Compound, AveragesPixelsThatAreFinerThanVoxels) {
  TrackedImages images;
  images.width = images.height = 40;
  for (int row = 0; row < 40; ++row)
    for (int col = 0; col < 40; ++col) images.pixels.push_back((row + col) % 2 == 0 ? 200 : 100);
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  T.linear().diagonal() << 0.25, 0.25, 1.0;
  images.T_us_pixel.push_back(T);
  const Grid grid = grid_of({8, 8, 1}, {1.0, 1.0, 0.0}, 1.0);
  CompoundOptions options;
  for (const std::uint8_t value : compound(images, grid, options).volume.voxels)
    EXPECT_EQ(value, 150);
  options.average_in_plane = false;
  EXPECT_EQ(compound(images, grid, options).volume.at(2, 3, 0), 200);
  // The average is centred on the voxel: a ramp is preserved.
  for (std::size_t i = 0; i < images.pixels.size(); ++i)
    images.pixels[i] = static_cast<std::uint8_t>(4 * (i % 40) + i / 40);
  options.average_in_plane = true;
  const ScanConverted ramp = compound(images, grid, options);
  for (int j = 0; j < 8; ++j)
    for (int i = 0; i < 8; ++i)
      EXPECT_EQ(ramp.volume.at(i, j, 0), 16 * (i + 1) + 4 * (j + 1)) << i << " " << j;
}

TEST(Compound, LeavesOutWhatTheImagesDoNotShow) {
  TrackedImages images = flat_images({{0.0, 100}});
  images.shown = shown_rectangle(21, 11, 4, 2, 10, 5);  // columns 4-13, rows 2-6
  const Grid grid = grid_of({21, 11, 1}, {0, 0, 0}, 1.0);
  const ScanConverted result = compound(images, grid, {});
  for (int j = 0; j < 11; ++j)
    for (int i = 0; i < 21; ++i)
      EXPECT_EQ(result.mask.at(i, j, 0) != 0, i >= 4 && i <= 13 && j >= 2 && j <= 6)
          << i << " " << j;
  EXPECT_THROW(shown_rectangle(21, 11, 4, 2, 18, 5), InputError);
  EXPECT_THROW(shown_rectangle(21, 11, -1, 2, 3, 5), InputError);
  const Grid around = image_grid(images, 1.0);
  EXPECT_TRUE(around.origin_mm.isApprox(Eigen::Vector3d(4, 2, 0)));
  EXPECT_EQ(around.size, Eigen::Vector3i(10, 5, 1));
}

TEST(Compound, IsTheSameForAnyNumberOfThreads) {
  TrackedImages images;
  images.width = images.height = 30;
  for (int n = 0; n < 20; ++n) {
    Eigen::Affine3d T(Eigen::AngleAxisd(0.1 * n, Eigen::Vector3d(1, 1, 0).normalized()));
    images.T_us_pixel.push_back(T);
    for (int i = 0; i < 900; ++i)
      images.pixels.push_back(static_cast<std::uint8_t>((i * 31 + n * 17) % 256));
  }
  CompoundOptions options;
  options.hole_fill_radius_mm = 2.0;
  const Grid grid = image_grid(images, 1.0);
  const auto compounded = [&] { return compound(images, grid, options); };
  const ScanConverted one = test::with_threads(1, compounded);
  const ScanConverted four = test::with_threads(4, compounded);
  EXPECT_EQ(one.volume.voxels, four.volume.voxels);
  EXPECT_EQ(one.mask.voxels, four.mask.voxels);
}

TEST(Compound, RefusesBadInputAndNamesIt) {
  const auto violation = [](const std::function<void(TrackedImages&, CompoundOptions&)>& change) {
    TrackedImages images = flat_images({{0.0, 100}, {1.0, 100}});
    CompoundOptions options;
    change(images, options);
    try {
      compound(images, grid_of({2, 2, 2}, {0, 0, 0}, 1.0), options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  using I = TrackedImages;
  using O = CompoundOptions;
  EXPECT_EQ(violation([](I&, O&) {}), "accepted");
  EXPECT_EQ(violation([](I&, O& o) { o.slice_thickness_mm = 0.0; }),
            "compounding: 'slice_thickness_mm' is 0, must be finite and > 0");
  EXPECT_EQ(violation([](I&, O& o) { o.hole_fill_radius_mm = -1.0; }),
            "compounding: 'hole_fill_radius_mm' is -1, must be finite and >= 0");
  EXPECT_EQ(violation([](I& i, O&) { i.pixels.pop_back(); }),
            "tracked images: holds 461 pixels, must hold 2 images of 21 x 11 pixels");
  EXPECT_EQ(
      violation([](I& i, O&) { i.T_us_pixel[1].linear().col(1).setZero(); }),
      "tracked images: 'T_us_pixel' of image 1 must be finite, with columns and rows that span "
      "a plane");
  EXPECT_EQ(violation([](I& i, O&) { i.shown = {1}; }),
            "tracked images: 'shown' has 1 entries, must have none or one per pixel of 21 x 11 "
            "pixels");
  EXPECT_EQ(violation([](I& i, O&) { i.shown.assign(21 * 11, 0); }),
            "tracked images: 'shown' is 0 everywhere, must be set for at least 1 pixel");
  EXPECT_EQ(violation([](I& i, O&) { i = I{}; }),
            "tracked images: images have 0 x 0 pixels, must have at least 1 x 1");
}

// A scanner's picture of a fan, resampled along its beams, shows the brightness of the tissue.
TEST(PreScanFromImages, ReadsThePictureAlongTheTrueBeams) {
  const CurvilinearArray array{30.0, centred_table(40, 1.5 * kDegree)};
  const AxialSampling axial{100, 1.0, 0.4};
  const auto tissue = [](const Eigen::Vector3d& p_us) {
    return 128.0 + 50.0 * std::sin(p_us.x() / 5.0) + 50.0 * std::cos(p_us.y() / 5.0 + p_us.z());
  };
  for (const double sign : {1.0, -1.0}) {  // the picture, and its mirror image
    const ImagePlacement placement{{130.0, -90.5}, {sign * 0.25, 0.3}};
    TrackedImages images;
    images.width = 260;
    images.height = 160;
    std::vector<Eigen::Isometry3d> poses;
    for (int n = 0; n < 2; ++n) {
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.linear() = Eigen::AngleAxisd(0.5 + n, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
      T.translation() = Eigen::Vector3d(3.0 * n, 7.0, -2.0);
      poses.push_back(T);
      Eigen::Affine3d T_frame_pixel = Eigen::Affine3d::Identity();
      T_frame_pixel.matrix()(0, 0) = sign * 0.25;
      T_frame_pixel.matrix()(1, 1) = 0.3;
      T_frame_pixel.matrix()(0, 3) = -sign * 0.25 * 130.0;
      T_frame_pixel.matrix()(1, 3) = 0.3 * 90.5;
      images.T_us_pixel.push_back(T * T_frame_pixel);
      for (int row = 0; row < images.height; ++row)
        for (int col = 0; col < images.width; ++col)
          images.pixels.push_back(static_cast<std::uint8_t>(
              std::lround(tissue(images.T_us_pixel.back() * Eigen::Vector3d(col, row, 0.0)))));
    }
    const PreScanVolume prescan = prescan_from_images(images, array, axial, placement);
    ASSERT_EQ(prescan.geometry.frames(), 2);
    const auto& sweep = std::get<TrackedSweep>(prescan.geometry.motion);
    for (std::size_t n = 0; n < 2; ++n) EXPECT_TRUE(sweep.T_us_frame[n].isApprox(poses[n], 1e-12));
    for (int frame = 0; frame < 2; ++frame)
      for (int line = 0; line < 40; ++line)
        for (int sample = 0; sample < 100; ++sample) {
          const double h = 31.0 + 0.4 * sample;
          const double theta = (line - 19.5) * 1.5 * kDegree;
          const Eigen::Vector3d p_frame(h * std::sin(theta), h * std::cos(theta), 0.0);
          const double row = -90.5 + p_frame.y() / 0.3;
          const double col = 130.0 + sign * p_frame.x() / 0.25;
          const int value = prescan.at(sample, line, frame);
          if (row > 0 && row < 159 && col > 0 && col < 259)
            EXPECT_NEAR(value, tissue(poses[static_cast<std::size_t>(frame)] * p_frame), 1.6);
          else
            EXPECT_EQ(value, 0);
        }
  }
}

TEST(PreScanFromImages, RefusesPosesThatContradictThePixelSize) {
  TrackedImages images = flat_images({{0.0, 100}});
  const CurvilinearArray array{5.0, centred_table(5, 0.1)};
  const auto message = [&](const ImagePlacement& placement) -> std::string {
    try {
      prescan_from_images(images, array, {10, 0.0, 0.5}, placement);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message({{10.0, 0.0}, {1.0, 1.0}}), "accepted");
  EXPECT_EQ(message({{10.0, 0.0}, {1.005, 1.0}}), "accepted");
  EXPECT_NE(
      message({{10.0, 0.0}, {1.02, 1.0}}).find("image 0: has pixels of 1.000000 x 1.000000 mm"),
      std::string::npos);
  EXPECT_NE(message({{1000.0, 0.0}, {1.0, 1.0}}).find("outside what the images show"),
            std::string::npos);
  EXPECT_NE(message({{10.0, 0.0}, {0.0, 1.0}}).find("pixel size not 0"), std::string::npos);
}

}  // namespace
}  // namespace usct
