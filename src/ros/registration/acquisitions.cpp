#include "ros/registration/acquisitions.h"

#include <algorithm>

#include "ros/conversions/times.h"
#include "ros/node/status.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;

/// No sweep takes longer: its recorder has gone.
constexpr std::chrono::minutes kLongestSweep{15};

}  // namespace

bool Acquisitions::has_arrived(const ::ros::Time& stamp) const {
  return std::find(arrived_.begin(), arrived_.end(), stamp) != arrived_.end();
}

void Acquisitions::announced(const Acquisition& acquisition, Clock::time_point now) {
  if (acquisition.id < newest_id_) return;  // a later one has begun meanwhile
  newest_id_ = acquisition.id;
  newest_.reset();
  // The volume may have been quicker.
  if (acquisition.state == Acquisition::RECORDED && has_arrived(acquisition.header.stamp)) return;
  newest_ = acquisition;
  heard_ = now;
}

void Acquisitions::arrived(const ::ros::Time& stamp, Clock::time_point now) {
  constexpr std::size_t kRemembered = 16;
  arrived_.push_back(stamp);
  if (arrived_.size() > kRemembered) arrived_.pop_front();
  if (!newest_ || newest_->state == Acquisition::RECORDING) return;
  const bool is_lost = newest_->state == Acquisition::RECORDED && now > heard_ + kPatience;
  if (newest_->header.stamp <= stamp || is_lost) newest_.reset();
}

void Acquisitions::forget() {
  newest_.reset();
  newest_id_ = 0;  // the sender's clock may have been set back as well
  arrived_.clear();
}

std::optional<Acquisitions::Acquisition> Acquisitions::awaited(Clock::time_point now) const {
  const bool is_dead =
      newest_ && newest_->state == Acquisition::RECORDING && now > heard_ + kLongestSweep;
  return is_dead ? std::nullopt : newest_;
}

bool Acquisitions::has_ended(const Acquisition& awaited) const {
  if (!newest_) return true;
  return newest_->id != awaited.id && !(last_arrived() < awaited.header.stamp);
}

std::optional<Refusal> Acquisitions::refusal(Clock::time_point asked, Clock::time_point now) const {
  if (!newest_) return std::nullopt;
  const std::string stamp = seconds_text(newest_->header.stamp);
  const std::string advice = "; ultrasound from before it may show another place";
  if (newest_->state == Acquisition::REFUSED)
    return Refusal(Status::NO_ULTRASOUND,
                   "the newest ultrasound was refused" + advice + ": " + newest_->reason);
  if (newest_->state == Acquisition::RECORDING) {
    if (now < asked + kPatienceWithSweep) return std::nullopt;
    return Refusal(Status::NO_ULTRASOUND,
                   "a sweep has been recorded since " + stamp + " s and has not ended" + advice);
  }
  if (now < heard_ + kPatience) return std::nullopt;
  return Refusal(Status::NO_ULTRASOUND, "the ultrasound with the stamp " + stamp +
                                            " was announced, but has not arrived" + advice);
}

}  // namespace usct::ros_interface
