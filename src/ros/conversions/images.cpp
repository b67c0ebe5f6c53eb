#include "ros/conversions/images.h"

#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <array>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

/// The bytes of a pixel that hold its colours; all three are one byte if it has only a brightness.
struct Encoding {
  const char* name;
  std::uint32_t bytes;  // per pixel
  std::uint32_t red;
  std::uint32_t green;
  std::uint32_t blue;
};

constexpr std::array<Encoding, 9> kEncodings = {{{"mono8", 1, 0, 0, 0},
                                                 {"8UC1", 1, 0, 0, 0},
                                                 {"mono16", 2, 1, 1, 1},  // little-endian
                                                 {"rgb8", 3, 0, 1, 2},
                                                 {"bgr8", 3, 2, 1, 0},
                                                 {"rgba8", 4, 0, 1, 2},
                                                 {"bgra8", 4, 2, 1, 0},
                                                 {"yuv422", 2, 1, 1, 1},  // U Y V Y
                                                 {"yuv422_yuy2", 2, 0, 0, 0}}};

Encoding readable_encoding(const sensor_msgs::Image& image, const std::string& source) {
  const auto known = std::find_if(kEncodings.begin(), kEncodings.end(),
                                  [&](const Encoding& e) { return image.encoding == e.name; });
  if (known == kEncodings.end()) {
    std::string all;
    for (const Encoding& e : kEncodings) all += (all.empty() ? "" : ", ") + std::string(e.name);
    throw InputError(source, "'encoding' is '" + image.encoding + "', must be one of " + all);
  }
  const std::uint64_t row_bytes = std::uint64_t{image.width} * known->bytes;
  if (image.step < row_bytes || std::uint64_t{image.step} * image.height != image.data.size())
    throw InputError(source, "'data' has " + std::to_string(image.data.size()) +
                                 " bytes, 'step' is " + std::to_string(image.step) + ", must be " +
                                 std::to_string(image.height) + " rows of " +
                                 std::to_string(row_bytes) + " bytes or more");
  Encoding encoding = *known;
  if (image.encoding == "mono16" && image.is_bigendian != 0)
    encoding.red = encoding.green = encoding.blue = 0;
  return encoding;
}

/// Weights of Rec. 601, in 1/256. A grey pixel of colours keeps its value.
std::uint8_t luma(std::uint32_t red, std::uint32_t green, std::uint32_t blue) {
  return static_cast<std::uint8_t>((77 * red + 150 * green + 29 * blue + 128) >> 8U);
}

}  // namespace

void require_readable(const sensor_msgs::Image& image, const std::string& source) {
  readable_encoding(image, source);
}

std::vector<std::uint8_t> brightness_from(const sensor_msgs::Image& image,
                                          const std::string& source) {
  const Encoding encoding = readable_encoding(image, source);
  std::vector<std::uint8_t> brightness;
  brightness.reserve(std::size_t{image.width} * image.height);
  for (std::uint32_t row = 0; row < image.height; ++row) {
    const std::uint8_t* pixel = image.data.data() + std::size_t{row} * image.step;
    for (std::uint32_t column = 0; column < image.width; ++column, pixel += encoding.bytes)
      brightness.push_back(luma(pixel[encoding.red], pixel[encoding.green], pixel[encoding.blue]));
  }
  return brightness;
}

sensor_msgs::Image to_message(const Picture& picture, const std_msgs::Header& header) {
  sensor_msgs::Image image;
  image.header = header;
  image.encoding = sensor_msgs::image_encodings::RGB8;
  image.width = static_cast<std::uint32_t>(picture.width);
  image.height = static_cast<std::uint32_t>(picture.height);
  image.step = 3 * image.width;
  image.data = picture.pixels;
  return image;
}

}  // namespace usct::ros_interface
