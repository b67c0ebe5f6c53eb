#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/io/expect_input_error.h"
#include "core/ultrasound/lagging_sweep.h"
#include "us_ct_registration/ultrasound/image_beams.h"
#include "us_ct_registration/ultrasound/image_sweep.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;
using test::expect_input_error;
using testing::HasSubstr;

constexpr double kInterval_s = 0.05;

std::int64_t nanoseconds(double seconds_from_start) {
  return 1'700'000'000'000'000'000 + std::llround(1e9 * seconds_from_start);
}

double from_start_s(std::int64_t stamp_ns) {
  return 1e-9 * static_cast<double>(stamp_ns - nanoseconds(0.0));
}

/// Images of the texture of lagging_sweep.h, 16 x 10 samples each, and the poses of their probe.
struct Live {
  explicit Live(const test::SweepCase& how, unsigned seed = 3) : volume(test::sweep_of(how, seed)) {
    along_mm = how.along_mm;
    options.axial = volume.geometry.axial;
    options.array = volume.geometry.array;
    options.us_frame_id = "base";
  }
  int count() const { return volume.geometry.frames(); }
  std::vector<std::uint8_t> image(int i) const {
    const auto first = volume.voxels.begin() + static_cast<std::ptrdiff_t>(volume.offset(0, 0, i));
    return {first, first + 160};
  }
  Isometry3d pose(double t) const {
    return Isometry3d(Translation3d(100.0, -40.0, along_mm(t)) *
                      Eigen::AngleAxisd(0.3, Vector3d::UnitX()));
  }
  ArrayPoseAt poses() const {
    return [this](std::int64_t stamp_ns) {
      return ArrayPoseThen{pose(from_start_s(stamp_ns)), {}};
    };
  }
  ImageSweep sweep() const {
    ImageSweep sweep(options, 4);
    for (int i = 0; i < count(); ++i) sweep.add(nanoseconds(kInterval_s * i), image(i));
    return sweep;
  }

  PreScanVolume volume;
  std::function<double(double)> along_mm;
  ImageSweepOptions options;
};

test::SweepCase unsteady(double lag_s) {
  test::SweepCase how;
  how.lag_s = lag_s;
  how.along_mm = test::unsteady_mm;
  return how;
}

const TrackedSweep& track(const PlacedSweep& placed) {
  return std::get<TrackedSweep>(placed.assembled.volume.geometry.motion);
}

/// Largest distance of a frame from where the probe was when its image was seen, mm.
double worst_mm(const PlacedSweep& placed, const Live& live, double lag_s) {
  double worst = 0.0;
  for (std::size_t i = 0; i < placed.assembled.frames.size(); ++i) {
    const double stamp_s = from_start_s(placed.assembled.frames[i]->stamp_ns);
    worst = std::max(worst, (track(placed).T_us_frame[i].translation() -
                             live.pose(stamp_s - lag_s).translation())
                                .norm());
  }
  return worst;
}

TEST(PlaceImages, CorrectsALagThatTheImagesDetermine) {
  for (const double lag_s : {-0.4, 0.0, 0.3}) {
    const Live live(unsteady(lag_s));
    const PlacedSweep placed = place_images(live.sweep(), live.poses(), {});
    EXPECT_TRUE(placed.lag.determined) << placed.lag.message;
    EXPECT_NEAR(placed.corrected_lag_s, lag_s, 0.03);
    EXPECT_EQ(placed.lag_source, "estimated from it");
    // No image is lost at the ends, unlike where poses are known at the images' stamps only; and
    // the probe moves by 18 mm/s at most.
    EXPECT_EQ(placed.assembled.frames.size(), static_cast<std::size_t>(live.count()));
    EXPECT_LT(worst_mm(placed, live, lag_s), 18.0 * 0.03);
    EXPECT_EQ(placed.assembled.us_frame_id, "base");
    EXPECT_NEAR(from_start_s(placed.assembled.stamps_ns[10]), 10 * kInterval_s - lag_s, 0.03);
    EXPECT_EQ(placed.assembled.volume.voxels, live.volume.voxels);
  }
}

TEST(PlaceImages, TakesImageLagIfTheImagesDoNotDetermineItOrMayNot) {
  Live steady(unsteady(0.3));
  steady.along_mm = [](double t) { return 10.0 * t; };
  steady.options.image_lag_s = 0.2;
  const PlacedSweep as_told = place_images(steady.sweep(), steady.poses(), {});
  EXPECT_FALSE(as_told.lag.determined);
  EXPECT_EQ(as_told.corrected_lag_s, 0.2);
  EXPECT_LT(worst_mm(as_told, steady, 0.2), 1e-6);

  Live live(unsteady(0.3));
  live.options.image_lag_s = 0.1;
  live.options.correct_lag = false;
  const PlacedSweep uncorrected = place_images(live.sweep(), live.poses(), {});
  EXPECT_EQ(uncorrected.corrected_lag_s, 0.1);
  EXPECT_LT(worst_mm(uncorrected, live, 0.1), 1e-6);
  // The lag that is left is found, and stated in full.
  EXPECT_TRUE(uncorrected.lag.determined);
  EXPECT_NEAR(uncorrected.lag.lag_s, 0.3, 0.03);
  EXPECT_LE(uncorrected.lag.interval_s.first, 0.31);
  EXPECT_GE(uncorrected.lag.interval_s.second, 0.29);
}

LagEstimate estimate(double lag_s, double standard_error_s, bool determined = true) {
  LagEstimate estimate;
  estimate.lag_s = lag_s;
  estimate.standard_error_s = standard_error_s;
  estimate.determined = determined;
  return estimate;
}

TEST(BetterLag, IsTheMoreCertainUnlessTheTwoContradictEachOther) {
  EXPECT_FALSE(better_lag({}, estimate(0.3, 0.01, false)));
  EXPECT_EQ(better_lag({}, estimate(0.3, 0.01))->lag_s, 0.3);
  EXPECT_EQ(better_lag(estimate(0.2, 0.01), estimate(0.3, 0.01, false))->lag_s, 0.2);
  EXPECT_EQ(better_lag(estimate(0.2, 0.01), estimate(0.24, 0.03))->lag_s, 0.2);
  EXPECT_EQ(better_lag(estimate(0.2, 0.03), estimate(0.24, 0.01))->lag_s, 0.24);
  EXPECT_EQ(better_lag(estimate(0.2, 0.01), estimate(0.5, 0.03))->lag_s, 0.5);
}

TEST(PlaceImages, UsesTheLagOfAnEarlierSweepIfItsOwnImagesDoNotTell) {
  Live live(unsteady(0.0));
  live.along_mm = [](double t) { return 10.0 * t; };
  const PlacedSweep placed = place_images(live.sweep(), live.poses(), estimate(0.25, 0.01));
  EXPECT_EQ(placed.corrected_lag_s, 0.25);
  EXPECT_EQ(placed.lag_source, "estimated from an earlier sweep");
}

TEST(PlaceImages, LeavesOutRepeatedImagesAlsoThoseThatDifferByNoise) {
  test::SweepCase how = unsteady(0.2);
  how.repeat_every = 7;
  Live live(how);
  live.options.repeat_tolerance = 0.5;
  ImageSweep sweep(live.options, 0);
  for (int i = 0; i < live.count(); ++i) {
    std::vector<std::uint8_t> image = live.image(i);
    // Every third pixel of a captured image is one grey value off, 1/3 on average.
    if (i % 2 == 1)
      for (std::size_t k = 0; k < image.size(); k += 3)
        image[k] = static_cast<std::uint8_t>(image[k] ^ 1U);
    sweep.add(nanoseconds(kInterval_s * i), image);
  }
  const PlacedSweep placed = place_images(sweep, live.poses(), {});
  // 200 images; those with the numbers 1, 8, 15, ... 197 repeat the one before.
  EXPECT_EQ(placed.dropped.at("repeated image"), 29U);
  EXPECT_EQ(sweep.distinct(), 171);
  EXPECT_EQ(placed.assembled.frames.size(), 171U);
  EXPECT_NEAR(placed.corrected_lag_s, 0.2, 0.03);
  EXPECT_LT(worst_mm(placed, live, 0.2), 18.0 * 0.03);
  EXPECT_EQ(placed.warning, "");
}

TEST(PlaceImages, RefusesWhatDoesNotChange) {
  Live live(unsteady(0.0));
  ImageSweep frozen(live.options, 2);
  for (int i = 0; i < 40; ++i) frozen.add(nanoseconds(kInterval_s * i), live.image(0));
  expect_input_error([&] { place_images(frozen, live.poses(), {}); },
                     {"sweep 2", "40 images", "all the same", "frozen"});

  // 10 mm/s: the picture is frozen over the last 8 of 10 s, then over 2.
  live.along_mm = [](double t) { return 10.0 * t; };
  const auto frozen_after = [&](int first) {
    ImageSweep sweep(live.options, 2);
    for (int i = 0; i <= 200; ++i)
      sweep.add(nanoseconds(kInterval_s * i), live.image(std::min(i, first)));
    return sweep;
  };
  expect_input_error([&] { place_images(frozen_after(40), live.poses(), {}); },
                     {"80 mm", "100 mm", "frozen"});
  EXPECT_THAT(place_images(frozen_after(160), live.poses(), {}).warning,
              HasSubstr("do not change over 20 mm of the probe's path of 100 mm"));

  live.along_mm = [](double t) { return 0.4 * std::sin(20.0 * t); };
  expect_input_error([&] { place_images(live.sweep(), live.poses(), {}); },
                     {"the probe moves by 0.", "1 mm"});
}

TEST(PlaceImages, SaysWhereImagesWereLost) {
  Live live(unsteady(0.0));
  live.along_mm = [](double t) { return 10.0 * t; };  // 0.5 mm from one image to the next
  const auto warning_without = [&](int first, int count) {
    ImageSweep sweep(live.options, 2);
    for (int i = 0; i < live.count(); ++i)
      if (i < first || i >= first + count) sweep.add(nanoseconds(kInterval_s * i), live.image(i));
    return place_images(sweep, live.poses(), {}).warning;
  };
  EXPECT_EQ(warning_without(60, 0), "");
  EXPECT_EQ(warning_without(60, 8), "");  // a hole of 4.5 mm
  EXPECT_THAT(warning_without(60, 19),
              HasSubstr("no image with a pose shows 10 mm of the probe's path"));
}

TEST(PlaceImages, RefusesTooManyImagesWithoutAPoseAndLeavesOutFew) {
  Live live(unsteady(0.0));
  live.options.correct_lag = false;
  const auto known_from = [&](double begin_s) -> ArrayPoseAt {
    return [&live, begin_s](std::int64_t stamp_ns) {
      const double t = from_start_s(stamp_ns);
      return t < begin_s ? ArrayPoseThen{std::nullopt, "tf has no 'probe'"}
                         : ArrayPoseThen{live.pose(t), {}};
    };
  };
  expect_input_error([&] { place_images(live.sweep(), known_from(1.999), {}); },
                     {"40 of 200 images have no pose", "tf has no 'probe'", "max_missing"});
  const PlacedSweep placed = place_images(live.sweep(), known_from(0.999), {});
  EXPECT_EQ(placed.assembled.frames.size(), 180U);
  EXPECT_EQ(placed.dropped.at("without pose"), 20U);
}

TEST(ImageSweep, RefusesToGoOnWhereStampsRunBackPauseOrTooMuchArrives) {
  Live live(unsteady(0.0));
  live.options.max_frames = 5;
  live.options.max_bytes = 160 * 4;
  ImageSweep sweep(live.options, 9);
  sweep.add(nanoseconds(1.0), live.image(0));
  sweep.add(nanoseconds(1.0), live.image(1));  // dropped
  EXPECT_EQ(sweep.images().size(), 1U);
  EXPECT_EQ(sweep.same_stamp(), 1U);
  expect_input_error([&] { sweep.add(nanoseconds(0.75), live.image(1)); },
                     {"sweep 9", "image 1", "0.25", "before"});
  expect_input_error([&] { sweep.add(nanoseconds(2.5), live.image(1)); },
                     {"no image for 1.5", "sweep_pause"});
  for (int i = 1; i < 4; ++i) sweep.add(nanoseconds(1.0 + i), live.image(i));
  expect_input_error([&] { sweep.add(nanoseconds(5.0), live.image(4)); }, {"640", "max_volume_mb"});
}

TEST(ImageBeams, InterpolatesALinearImageExactlyAndLeavesOutWhatIsNotShown) {
  // Brightness 10 + 3 column + 7 row; the array is at column 5.5, row 2, pixels are 0.5 x 0.25 mm.
  constexpr int kWidth = 12;
  constexpr int kHeight = 20;
  std::vector<std::uint8_t> pixels;
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column)
      pixels.push_back(static_cast<std::uint8_t>(10 + 3 * column + 7 * row));
  const LinearArray array{{-1.5, -0.25, 1.0}};
  const AxialSampling axial{4, 0.5, 1.0};
  const ImagePlacement placement{{5.5, 2.0}, {0.5, 0.25}};
  const ImageBeams all(kWidth, kHeight, {}, array, axial, placement);
  std::vector<std::uint8_t> found(all.size());
  all.resample(pixels.data(), found.data());
  for (int line = 0; line < 3; ++line)
    for (int sample = 0; sample < 4; ++sample) {
      const double column = 5.5 + array.line_positions_mm[static_cast<std::size_t>(line)] / 0.5;
      const double row = 2.0 + (0.5 + sample) / 0.25;
      const double expected = row <= kHeight - 1 ? 10.0 + 3.0 * column + 7.0 * row : 0.0;
      EXPECT_NEAR(found[static_cast<std::size_t>(4 * line + sample)], expected, 0.5001);
    }
  // Shown from column 4 on: the first line is at column 2.5.
  const ImageBeams cropped(kWidth, kHeight,
                           shown_rectangle(kWidth, kHeight, 4, 0, kWidth - 4, kHeight), array,
                           axial, placement);
  std::vector<std::uint8_t> right(cropped.size());
  cropped.resample(pixels.data(), right.data());
  EXPECT_THAT(std::vector<std::uint8_t>(right.begin(), right.begin() + 4), testing::Each(0));
  EXPECT_TRUE(std::equal(right.begin() + 4, right.end(), found.begin() + 4));

  expect_input_error(
      [&] {
        ImageBeams(kWidth, kHeight, {}, array, axial, {{-900.0, 0.0}, {0.5, 0.25}});
      },
      {"image placement", "outside"});
  expect_input_error(
      [&] {
        ImageBeams(kWidth, kHeight, {}, array, axial, {{0, 0}, {0.5, 0.0}});
      },
      {"image placement", "pixel size"});
}

}  // namespace
}  // namespace usct
