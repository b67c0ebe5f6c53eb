#include "ros/tf/tf_watch.h"

#include <utility>

#include "ros/tf/frame_name.h"

namespace usct::ros_interface {
namespace {

/// Least number of own transforms that are remembered: some seconds at the highest rate.
constexpr std::size_t kRemembered = 4096;

}  // namespace

void TfWatch::sent(const geometry_msgs::TransformStamped& transform) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (sent_.size() >= kRemembered) {
    sent_before_ = std::move(sent_);
    sent_.clear();
  }
  sent_[{transform.header.stamp, transform.child_frame_id}] = transform;
}

bool TfWatch::is_own(const geometry_msgs::TransformStamped& transform) const {
  for (const Sent* sent : {&sent_, &sent_before_}) {
    const auto own = sent->find({transform.header.stamp, transform.child_frame_id});
    if (own != sent->end() && own->second.header.frame_id == transform.header.frame_id &&
        own->second.transform == transform.transform)
      return true;
  }
  return false;
}

void TfWatch::heard(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
                    bool is_static, Clock::time_point now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (is_own(transform)) return;
  heard_[frame_name(transform.child_frame_id)] = {frame_name(transform.header.frame_id), publisher,
                                                  is_static, now};
}

const TfWatch::Heard* TfWatch::find(const std::string& child, Clock::time_point now) const {
  const auto found = heard_.find(child);
  if (found == heard_.end()) return nullptr;
  const bool is_forgotten = !found->second.is_static && now - found->second.when > kMemory;
  return is_forgotten ? nullptr : &found->second;
}

std::string TfWatch::conflict(const std::string& fixed_frame, const std::string& ct_frame,
                              Clock::time_point now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (const Heard* other = find(ct_frame, now))
    return "node '" + other->publisher + "' publishes '" + other->parent + "' -> '" + ct_frame +
           "' in tf" +
           (other->parent == fixed_frame
                ? " as well"
                : ", and a frame has one parent, here '" + fixed_frame + "'");
  std::string path = "'" + fixed_frame + "'";
  std::string frame = fixed_frame;
  // The count ends the search if others have made a loop.
  for (std::size_t i = 0; i < heard_.size(); ++i) {
    const Heard* above = find(frame, now);
    if (above == nullptr) return "";
    frame = above->parent;
    path = "'" + frame + "' -> " + path;
    if (frame == ct_frame)
      return "'" + fixed_frame + "' is below '" + ct_frame + "' in tf (" + path +
             "; the last by node '" + above->publisher + "'), which would make a loop";
  }
  return "";
}

}  // namespace usct::ros_interface
