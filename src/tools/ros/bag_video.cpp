#include "tools/ros/bag_video.h"

#include <cv_bridge/cv_bridge.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/Image.h>

#include <cstdio>
#include <memory>
#include <opencv2/videoio.hpp>

#include "tools/exit_status.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/rendering/picture.h"

namespace usct::tools {
namespace {

namespace fs = std::filesystem;

struct BagVideoCommand {
  std::string bag;
  std::string topic;
  std::string video;
  std::string picture;
};

using Images = std::vector<sensor_msgs::ImageConstPtr>;

Images read_images(const BagVideoCommand& command) {
  Images images;
  try {
    const rosbag::Bag bag(command.bag);
    for (const rosbag::MessageInstance& message :
         rosbag::View(bag, rosbag::TopicQuery(command.topic)))
      if (const auto image = message.instantiate<sensor_msgs::Image>()) images.push_back(image);
  } catch (const rosbag::BagException& error) {
    throw InputError(command.bag, error.what());
  }
  if (images.empty()) throw InputError(command.bag, "has no images on '" + command.topic + "'");
  return images;
}

cv::Mat pixels_of(const sensor_msgs::ImageConstPtr& image, const char* encoding) {
  try {
    return cv_bridge::toCvShare(image, encoding)->image.clone();
  } catch (const cv_bridge::Exception& error) {
    throw InputError("image", error.what());
  }
}

double rate_hz(const Images& images) {
  const double seconds = (images.back()->header.stamp - images.front()->header.stamp).toSec();
  constexpr double kOfOneImage = 10.0;
  return seconds > 0.0 ? static_cast<double>(images.size() - 1) / seconds : kOfOneImage;
}

/// Motion JPEG, by OpenCV's own writer, which needs no codec.
void write_video(const Images& images, const fs::path& path) {
  if (path.extension() != ".avi") throw InputError(path.string(), "must end in .avi");
  const cv::Size size(static_cast<int>(images.front()->width),
                      static_cast<int>(images.front()->height));
  write_atomically(path, [&](const fs::path& temporary) {
    cv::VideoWriter writer(temporary.string(), cv::CAP_OPENCV_MJPEG,
                           cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), rate_hz(images), size);
    if (!writer.isOpened()) throw InputError(path.string(), "cannot be written");
    for (const sensor_msgs::ImageConstPtr& image : images) {
      const cv::Mat pixels = pixels_of(image, "bgr8");
      if (pixels.size() != size) throw InputError(path.string(), "the images differ in size");
      writer.write(pixels);
    }
    writer.release();
    // The writer does not say whether the disk took all of it.
    const cv::VideoCapture written(temporary.string(), cv::CAP_OPENCV_MJPEG);
    const auto count = static_cast<std::size_t>(written.get(cv::CAP_PROP_FRAME_COUNT));
    if (count != images.size())
      throw std::runtime_error(path.string() + ": writing failed: only " + std::to_string(count) +
                               " of " + std::to_string(images.size()) +
                               " images are in the file; the disk may be full");
  });
}

void write_picture(const sensor_msgs::ImageConstPtr& image, const fs::path& path) {
  const cv::Mat pixels = pixels_of(image, "rgb8");
  Picture picture(pixels.cols, pixels.rows);
  std::copy(pixels.begin<cv::Vec3b>(), pixels.end<cv::Vec3b>(),
            reinterpret_cast<cv::Vec3b*>(picture.pixels.data()));
  write_png(picture, path);
}

int run_video(const BagVideoCommand& command) {
  // Before the video is written.
  if (!command.picture.empty() && fs::path(command.picture).extension() != ".png")
    throw InputError("--picture", "is '" + command.picture + "', must end in .png");
  const Images images = read_images(command);
  write_video(images, command.video);
  if (!command.picture.empty()) write_picture(images[images.size() / 2], command.picture);
  for (const std::string& written : {command.video, command.picture})
    if (!written.empty()) std::printf("%s\n", written.c_str());
  return kDone;
}

}  // namespace

void add_video_command(CLI::App& bag, Run& run) {
  CLI::App* sub = bag.add_subcommand(
      "video",
      "Makes a video, and a picture, of the images of a bag, such as those of the overlay.");
  auto command = std::make_shared<BagVideoCommand>();
  sub->add_option("bag", command->bag, "bag to read")->required();
  sub->add_option("--topic", command->topic, "topic of the images, with its leading slash")
      ->required();
  sub->add_option("--output", command->video, "video to write, .avi (Motion JPEG)")->required();
  writes(sub->add_option("--picture", command->picture, "the middle image as a picture, .png"));
  sub->callback([command, &run] { run = [command] { return run_video(*command); }; });
}

}  // namespace usct::tools
