#include "ros/registration/stillness_watch.h"

#include <exception>

namespace usct::ros_interface {

std::shared_future<bool> StillnessWatch::judgement_of(const std_msgs::Header& us,
                                                      const FixedPose& pose,
                                                      Clock::time_point deadline) {
  waiting_.push_back({us, pose, deadline, {}});
  return waiting_.back().judgement.get_future().share();
}

void StillnessWatch::judge() {
  for (auto one = waiting_.begin(); one != waiting_.end();) {
    const bool is_complete = frame_.is_complete(one->us);
    if (!is_complete && Clock::now() < one->deadline) {
      ++one;
      continue;
    }
    try {
      frame_.require_still(one->us, one->pose);
      one->judgement.set_value(is_complete);
    } catch (...) {
      one->judgement.set_exception(std::current_exception());
    }
    one = waiting_.erase(one);
  }
}

}  // namespace usct::ros_interface
