#include "ros/registration/decision_watch.h"

namespace usct::ros_interface {

void DecisionWatch::offered(Clock::time_point now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  on_its_way_until_ = now + kOnItsWay;
}

void DecisionWatch::arrived(const us_ct_registration::Alignment& alignment) {
  const std::lock_guard<std::mutex> lock(mutex_);
  was_heard_ = true;
  needs_person_ = alignment.policy == "confirm";
  waits_ = alignment.waiting_id != 0;
  on_its_way_until_ = {};
}

bool DecisionWatch::is_awaited(Clock::time_point now) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!was_heard_) return now < begun_ + kOnItsWay;
  return needs_person_ && (waits_ || now < on_its_way_until_);
}

}  // namespace usct::ros_interface
