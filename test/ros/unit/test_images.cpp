#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/expect_input_error.h"
#include "ros/conversions/images.h"

namespace usct::ros_interface {
namespace {

using test::expect_input_error;
using testing::ElementsAre;

/// An image of 2 x 2 pixels, with one byte of padding per row.
sensor_msgs::Image image(const std::string& encoding, std::vector<std::uint8_t> data) {
  sensor_msgs::Image image;
  image.encoding = encoding;
  image.width = image.height = 2;
  image.step = static_cast<std::uint32_t>(data.size() / 2 + 1);
  image.data = std::move(data);
  image.data.insert(image.data.begin() + static_cast<std::ptrdiff_t>(image.data.size() / 2), 99);
  image.data.push_back(99);
  return image;
}

TEST(Brightness, IsThatOfThePixelsWhateverTheirBytes) {
  EXPECT_THAT(brightness_from(image("mono8", {1, 2, 3, 4}), ""), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(brightness_from(image("8UC1", {1, 2, 3, 4}), ""), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(brightness_from(image("yuv422", {9, 1, 9, 2, 9, 3, 9, 4}), ""),
              ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(brightness_from(image("yuv422_yuy2", {1, 9, 2, 9, 3, 9, 4, 9}), ""),
              ElementsAre(1, 2, 3, 4));
  sensor_msgs::Image deep = image("mono16", {9, 1, 9, 2, 9, 3, 9, 4});
  EXPECT_THAT(brightness_from(deep, ""), ElementsAre(1, 2, 3, 4));
  deep.is_bigendian = 1;
  EXPECT_THAT(brightness_from(deep, ""), ElementsAre(9, 9, 9, 9));
}

TEST(Brightness, OfColoursIsTheirLumaAndOfGreyTheGrey) {
  // Rec. 601: 0.299 red + 0.587 green + 0.114 blue.
  const std::vector<std::uint8_t> colours = {200, 0, 0, 0, 200, 0, 0, 0, 200, 255, 255, 255};
  EXPECT_THAT(brightness_from(image("rgb8", colours), ""), ElementsAre(60, 117, 23, 255));
  EXPECT_THAT(brightness_from(image("bgr8", colours), ""), ElementsAre(23, 117, 60, 255));
  for (int grey = 0; grey < 256; ++grey) {
    const auto v = static_cast<std::uint8_t>(grey);
    EXPECT_THAT(
        brightness_from(image("bgra8", {v, v, v, 0, v, v, v, 9, v, v, v, 99, v, v, v, 255}), ""),
        ElementsAre(v, v, v, v));
  }
}

TEST(Brightness, RefusesWhatItCannotReadAndNamesIt) {
  expect_input_error(
      [] {
        brightness_from(image("bayer_rggb8", {1, 2, 3, 4}), "us/image");
      },
      {"us/image", "'encoding' is 'bayer_rggb8'", "mono8", "yuv422_yuy2"});
  sensor_msgs::Image cut = image("rgb8", {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12});
  cut.data.pop_back();
  expect_input_error([&] { brightness_from(cut, "us/image"); },
                     {"us/image", "'data' has 13 bytes", "'step' is 7", "2 rows of 6"});
  sensor_msgs::Image narrow = image("rgb8", {1, 2, 3, 4});
  expect_input_error([&] { require_readable(narrow, "us/image"); }, {"'step' is 3", "6 bytes"});
  sensor_msgs::Image huge = image("mono8", {1, 2, 3, 4});
  huge.width = huge.height = huge.step = 4294967295U;
  expect_input_error([&] { require_readable(huge, "us/image"); }, {"'data' has 6 bytes"});
}

}  // namespace
}  // namespace usct::ros_interface
