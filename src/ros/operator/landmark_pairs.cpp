#include "ros/operator/landmark_pairs.h"

#include <algorithm>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using Request = us_ct_registration::SetInitialAlignment::Request;
using visualization_msgs::Marker;

constexpr std::size_t kLeastPairs = 3;

/// A sphere, or the number beside it; without a point what removes them.
Marker marker(const std::string& name, std::size_t number, const std::string& frame,
              const std::optional<geometry_msgs::Point>& point, bool is_text) {
  constexpr double kSizeM = 0.005;
  Marker marker;
  marker.header.frame_id = frame;
  marker.ns = name + (is_text ? " numbers" : "");
  marker.id = static_cast<int>(number);
  marker.type = is_text ? Marker::TEXT_VIEW_FACING : Marker::SPHERE;
  marker.text = std::to_string(number);
  marker.action = point ? Marker::ADD : Marker::DELETE;
  if (point) marker.pose.position = *point;
  if (is_text) marker.pose.position.z += kSizeM;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = is_text ? 2.0 * kSizeM : kSizeM;
  marker.color.r = name == "CT" ? 1.0F : 0.3F;
  marker.color.g = 0.75F;
  marker.color.b = name == "CT" ? 0.2F : 1.0F;
  marker.color.a = 1.0F;
  return marker;
}

}  // namespace

void LandmarkPairs::hold_ct(const std::string& frame, std::uint32_t crc32) {
  if (frame != ct_frame_ || crc32 != ct_crc32_) pairs_.clear();
  ct_frame_ = frame;
  ct_crc32_ = crc32;
}

void LandmarkPairs::add(const std::string& frame, const geometry_msgs::Point& point) {
  const std::string source = "the point in '" + frame + "' is not used";
  if (ct_frame_.empty()) throw InputError(source, "no CT is known yet");
  if (frame == ct_frame_) {
    if (is_open()) pairs_.pop_back();
    pairs_.push_back({point, std::nullopt});
    most_ = std::max(most_, pairs_.size());
    return;
  }
  if (!is_open())
    throw InputError(source,
                     "the point in the CT must come first, in the CT's frame '" + ct_frame_ + "'");
  if (pairs_.size() > 1 && frame != us_frame_)
    throw InputError(source, "the other points of the ultrasound lie in '" + us_frame_ + "'");
  us_frame_ = frame;
  pairs_.back().us = point;
}

void LandmarkPairs::remove(std::size_t index) {
  pairs_.erase(pairs_.begin() + static_cast<std::ptrdiff_t>(index));
}

std::string LandmarkPairs::next_step() const {
  const std::string number = std::to_string(pairs_.size());
  if (is_open()) return "now show landmark " + number + " in the ultrasound";
  const std::string next = "show landmark " + std::to_string(pairs_.size() + 1) + " in the CT";
  return pairs_.size() < kLeastPairs ? next : "use the " + number + " pairs, or " + next;
}

bool LandmarkPairs::is_ready() const { return !is_open() && pairs_.size() >= kLeastPairs; }

Request LandmarkPairs::request() const {
  if (!is_ready())
    throw InputError("landmarks", "there are " + std::to_string(pairs_.size() - is_open()) +
                                      " complete of " + std::to_string(pairs_.size()) +
                                      " pairs, must be at least 3, all complete");
  Request request;
  request.type = Request::LANDMARKS;
  request.header.frame_id = us_frame_;
  for (const LandmarkPair& pair : pairs_) {
    request.points_ct.push_back(pair.ct);
    request.points.push_back(*pair.us);
  }
  return request;
}

visualization_msgs::MarkerArray LandmarkPairs::markers() const {
  visualization_msgs::MarkerArray array;
  for (std::size_t i = 0; i < most_; ++i) {
    std::optional<geometry_msgs::Point> ct;
    std::optional<geometry_msgs::Point> us;
    if (i < pairs_.size()) {
      ct = pairs_[i].ct;
      us = pairs_[i].us;
    }
    for (const bool is_text : {false, true}) {
      array.markers.push_back(marker("CT", i + 1, ct_frame_, ct, is_text));
      if (!us_frame_.empty())
        array.markers.push_back(marker("ultrasound", i + 1, us_frame_, us, is_text));
    }
  }
  return array;
}

}  // namespace usct::ros_interface
