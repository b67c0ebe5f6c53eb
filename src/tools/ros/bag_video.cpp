#include "tools/ros/bag_video.h"

#include <cv_bridge/cv_bridge.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/Image.h>

#include <cstdio>
#include <memory>
#include <opencv2/videoio.hpp>

#include "ros/bags/acquisition_bag.h"
#include "tools/exit_status.h"
#include "tools/option_checks.h"
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

/// The images of a topic, read one by one: a video of minutes has gigabytes.
class ImagesOfBag {
 public:
  explicit ImagesOfBag(const BagVideoCommand& command) : file_(command.bag), topic_(command.topic) {
    for_each([&](const sensor_msgs::ImageConstPtr& image) {
      if (count_++ == 0) first_ = image->header.stamp;
      last_ = image->header.stamp;
    });
    if (count_ == 0) throw InputError(file_, "has no images on '" + topic_ + "'");
  }

  std::size_t count() const { return count_; }
  double rate_hz() const {
    const double seconds = (last_ - first_).toSec();
    constexpr double kOfOneImage = 10.0;
    return seconds > 0.0 ? static_cast<double>(count_ - 1) / seconds : kOfOneImage;
  }
  template <typename Take>
  void for_each(const Take& take) const try {
    const rosbag::Bag bag(file_);
    for (const rosbag::MessageInstance& message : rosbag::View(bag, rosbag::TopicQuery(topic_)))
      if (const auto image = message.instantiate<sensor_msgs::Image>()) take(image);
  } catch (const rosbag::BagException& error) {
    throw InputError(file_, ros_interface::words_for_bad_bag(file_, error.what()));
  }

 private:
  std::string file_;
  std::string topic_;
  std::size_t count_ = 0;
  ::ros::Time first_;
  ::ros::Time last_;
};

cv::Mat pixels_of(const sensor_msgs::ImageConstPtr& image, const char* encoding) {
  try {
    return cv_bridge::toCvShare(image, encoding)->image.clone();
  } catch (const cv_bridge::Exception& error) {
    throw InputError("image", error.what());
  }
}

/// Motion JPEG, by OpenCV's own writer, which needs no codec.
void write_video(const ImagesOfBag& images, const fs::path& path) {
  write_atomically(path, [&](const fs::path& temporary) {
    cv::VideoWriter writer;
    cv::Size size;
    images.for_each([&](const sensor_msgs::ImageConstPtr& image) {
      const cv::Mat pixels = pixels_of(image, "bgr8");
      if (!writer.isOpened()) {
        size = pixels.size();
        if (!writer.open(temporary.string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), images.rate_hz(), size))
          throw InputError(path.string(), "cannot be written");
      }
      if (pixels.size() != size) throw InputError(path.string(), "the images differ in size");
      writer.write(pixels);
    });
    writer.release();
    // The writer does not say whether the disk took all of it.
    const cv::VideoCapture written(temporary.string(), cv::CAP_OPENCV_MJPEG);
    const auto count = static_cast<std::size_t>(written.get(cv::CAP_PROP_FRAME_COUNT));
    if (count != images.count())
      throw std::runtime_error(path.string() + ": writing failed: only " + std::to_string(count) +
                               " of " + std::to_string(images.count()) +
                               " images are in the file; the disk may be full");
  });
}

/// The middle image.
void write_picture(const ImagesOfBag& images, const fs::path& path) {
  std::size_t index = 0;
  images.for_each([&](const sensor_msgs::ImageConstPtr& image) {
    if (index++ != images.count() / 2) return;
    const cv::Mat pixels = pixels_of(image, "rgb8");
    Picture picture(pixels.cols, pixels.rows);
    std::copy(pixels.begin<cv::Vec3b>(), pixels.end<cv::Vec3b>(),
              reinterpret_cast<cv::Vec3b*>(picture.pixels.data()));
    write_png(picture, path);
  });
}

int run_video(const BagVideoCommand& command) {
  require_place_ending("--output", command.video, ".avi");
  if (!command.picture.empty()) require_place_ending("--picture", command.picture, ".png");
  const ImagesOfBag images(command);
  write_video(images, command.video);
  if (!command.picture.empty()) write_picture(images, command.picture);
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
