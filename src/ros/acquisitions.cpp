#include "ros/acquisitions.h"

#include "ros/conversions/times.h"
#include "ros/status.h"

namespace usct::ros_interface {
namespace {

using us_ct_registration::Acquisition;
using Status = us_ct_registration::StatusCode;

/// No sweep takes longer: its recorder has gone.
constexpr std::chrono::minutes kLongestSweep{5};

}  // namespace

void Acquisitions::announced(const Acquisition& acquisition, Clock::time_point now) {
  newest_.reset();
  // The volume, or one after it, may have been quicker.
  if (acquisition.header.stamp <= last_arrived_) return;
  newest_ = acquisition;
  heard_ = now;
}

void Acquisitions::arrived(const ::ros::Time& stamp, Clock::time_point now) {
  last_arrived_ = stamp;
  if (!newest_) return;
  const bool is_lost = newest_->state == Acquisition::RECORDED && now > heard_ + kPatience;
  if (newest_->header.stamp <= stamp || is_lost) newest_.reset();
}

void Acquisitions::forget() {
  newest_.reset();
  last_arrived_ = ::ros::Time();
}

std::optional<::ros::Time> Acquisitions::awaited(Clock::time_point now) const {
  if (!newest_ || (newest_->state == Acquisition::RECORDING && now > heard_ + kLongestSweep))
    return std::nullopt;
  return newest_->header.stamp;
}

bool Acquisitions::has_ended(const ::ros::Time& awaited) const {
  return !newest_ || !(last_arrived_ < awaited);
}

std::optional<Refusal> Acquisitions::refusal(Clock::time_point asked, Clock::time_point now) const {
  if (!newest_) return std::nullopt;
  const std::string stamp = seconds_text(newest_->header.stamp);
  const std::string advice = "; ultrasound from before it may show another place";
  if (newest_->state == Acquisition::REFUSED)
    return Refusal(Status::NO_ULTRASOUND,
                   "the newest ultrasound was refused" + advice + ": " + newest_->reason);
  if (newest_->state == Acquisition::RECORDING) {
    if (now < asked + kPatience) return std::nullopt;
    return Refusal(Status::NO_ULTRASOUND,
                   "a sweep has been recorded since " + stamp + " s and has not ended" + advice);
  }
  if (now < heard_ + kPatience) return std::nullopt;
  return Refusal(Status::NO_ULTRASOUND, "the ultrasound with the stamp " + stamp +
                                            " was announced, but has not arrived" + advice);
}

}  // namespace usct::ros_interface
