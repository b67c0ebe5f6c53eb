#pragma once

#include <sensor_msgs/Image.h>

#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/rendering/picture.h"

namespace usct::ros_interface {

/// Throws InputError, naming `source`, for an encoding other than mono8, 8UC1, mono16, rgb8, bgr8,
/// rgba8, bgra8, yuv422 and yuv422_yuy2, and for sizes that do not fit the data.
void require_readable(const sensor_msgs::Image& image, const std::string& source);

/// The brightness of an image's pixels, width x height, columns fastest: of a coloured image its
/// luma (Rec. 601), of 16 bits the upper 8. Throws as `require_readable`.
std::vector<std::uint8_t> brightness_from(const sensor_msgs::Image& image,
                                          const std::string& source);

/// The picture as an image with the encoding rgb8.
sensor_msgs::Image to_message(const Picture& picture, const std_msgs::Header& header);

}  // namespace usct::ros_interface
