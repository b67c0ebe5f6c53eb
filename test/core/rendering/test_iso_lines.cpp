#include <gtest/gtest.h>

#include <random>

#include "rendering/iso_lines.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::rendering {
namespace {

cv::Mat1b all_known(const cv::Mat1f& values) { return {values.size(), std::uint8_t{255}}; }

TEST(IsoLines, LieBetweenPixelsWhereALinearSlopePassesTheLevel) {
  cv::Mat1f values(5, 9);
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 9; ++x) values(y, x) = static_cast<float>(10 * x + 4 * y);
  const std::vector<Segment> lines = iso_lines(values, all_known(values), 43.0F, 0.0);
  double length = 0.0;
  for (const Segment& segment : lines) {
    for (const cv::Point2d& p : {segment.from, segment.to})
      EXPECT_NEAR(10.0 * p.x + 4.0 * p.y, 43.0, 1e-5);
    length += cv::norm(segment.to - segment.from);
  }
  EXPECT_NEAR(length, std::hypot(4.0, 1.6), 1e-6);  // from the top row to the bottom one
}

TEST(IsoLines, StopAtWhatIsNotKnown) {
  cv::Mat1f values(6, 6, 0.0F);
  values.colRange(3, 6).setTo(1.0F);
  cv::Mat1b known = all_known(values);
  known(2, 3) = 0;
  const std::vector<Segment> lines = iso_lines(values, known, 0.5F, 0.0);
  ASSERT_EQ(lines.size(), 3U);  // 5 cells, of which the pixel takes 2
  for (const Segment& segment : lines) EXPECT_FALSE(segment.from.y == 2.0 && segment.to.y == 2.0);
}

TEST(IsoLines, AreMeasuredAsConnectedLines) {
  cv::Mat1f values(20, 20, 0.0F);
  values(3, 3) = 1.0F;                       // a diamond around it: 2 sqrt(2) long
  values(cv::Rect(8, 8, 6, 6)).setTo(1.0F);  // 4 * 5 + 2 sqrt(2)
  const auto longer_than = [&](double length_px) {
    return iso_lines(values, all_known(values), 0.5F, length_px).size();
  };
  EXPECT_EQ(longer_than(2.8), 28U);  // 4 segments, and 4 * 5 straight with 4 corners
  EXPECT_EQ(longer_than(2.9), 24U);
  EXPECT_EQ(longer_than(22.8), 24U);
  EXPECT_EQ(longer_than(22.9), 0U);
}

TEST(IsoLines, OfASaddleNeverCross) {
  const cv::Mat1f values = (cv::Mat1f(2, 2) << 1.0F, 0.0F, 0.0F, 0.6F);
  // The mean is 0.4: below 0.5 the low corners are connected, the lines cut off the high ones.
  const std::vector<Segment> lines = iso_lines(values, all_known(values), 0.5F, 0.0);
  ASSERT_EQ(lines.size(), 2U);
  for (const Segment& segment : lines) {
    const cv::Point2d middle = 0.5 * (segment.from + segment.to);
    EXPECT_GT(std::abs(middle.x + middle.y - 1.0), 0.3);
  }
  EXPECT_EQ(iso_lines(values, all_known(values), 0.3F, 0.0).size(), 2U);
}

TEST(OtsuThreshold, PartsTwoKindsOfValues) {
  std::mt19937 generator(7);
  std::normal_distribution<float> low(40.0F, 8.0F);
  std::normal_distribution<float> high(150.0F, 12.0F);
  std::vector<float> values(3000);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = i % 3 == 0 ? high(generator) : low(generator);
  const Threshold two = otsu_threshold(values);
  EXPECT_GT(two.value, 70.0);
  EXPECT_LT(two.value, 115.0);
  EXPECT_NEAR(two.above, 1.0 / 3.0, 1e-3);
  EXPECT_GT(two.separation, 0.95);
}

TEST(OtsuThreshold, SeparationOfOneKindIsTwoOverPi) {
  std::mt19937 generator(7);
  std::normal_distribution<float> one(40.0F, 8.0F);
  std::vector<float> values(20000);
  for (float& value : values) value = one(generator);
  EXPECT_NEAR(otsu_threshold(values).separation, 2.0 / kPi, 0.01);
  EXPECT_EQ(otsu_threshold({}).separation, 0.0);
  EXPECT_EQ(otsu_threshold({5.0F, 5.0F, 5.0F}).separation, 0.0);
}

}  // namespace
}  // namespace usct::rendering
