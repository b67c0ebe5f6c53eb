#include "ros/registration/held_volumes.h"

#include <algorithm>
#include <functional>

#include "ros/conversions/ct.h"
#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;

constexpr std::chrono::milliseconds kPoll(5);

/// The conversions do not check headers.
void require_header(const std_msgs::Header& header, const ::ros::Time& now,
                    const std::string& source) {
  require_stamped(header.stamp, now, source);
  if (header.frame_id.empty()) throw InputError(source, "'header.frame_id' is empty, must be set");
}

/// Whether tf may tell later what it could not: frames may be connected after the volume has come.
bool may_come_later(const Refusal& refusal) {
  return refusal.code() == Status::TF_UNAVAILABLE || refusal.code() == Status::TF_STALE;
}

void require_not(const std::function<bool()>& cancelled) {
  if (cancelled()) throw Refusal(Status::CANCELLED, "cancelled by the caller");
}

}  // namespace

HeldVolumes::HeldVolumes(const FixedFrame& frame, HeldVolumesOptions options,
                         std::function<void()> changed)
    : frame_(frame),
      options_(options),
      changed_(std::move(changed)),
      newest_ct_(std::chrono::duration<double>(options.ct_patience_s)),
      worker_([this] { work(); }) {}

HeldVolumes::~HeldVolumes() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  worker_.join();
}

void HeldVolumes::set_time(const ::ros::Time& now) {
  if (ran_back(now, last_now_)) {
    epoch_ = {epoch_.number + 1, now};
    last_now_ = now;
    // Stamps from before the jump are not comparable with those that follow.
    acquisitions_.forget();
  }
  last_now_ = std::max(last_now_, now);
}

void HeldVolumes::notice_time(const ::ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  set_time(now);
}

void HeldVolumes::arrived(const msg::CtVolume::ConstPtr& message, const ::ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  set_time(now);
  ct_arrival_ = CtArrival{message, now, epoch_, 0};
  newest_ct_.arrived(*message, Clock::now());
  wake_.notify_all();
}

void HeldVolumes::arrived(const msg::PreScanVolume::ConstPtr& message, const ::ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  set_time(now);
  ultrasound_arrivals_.push_back({message, now, epoch_, ++arrived_ultrasound_});
  acquisitions_.arrived(message->header.stamp, Clock::now());
  // Volumes that would be dropped right after their conversion are not converted.
  while (ultrasound_arrivals_.size() > static_cast<std::size_t>(options_.ultrasound_volumes))
    ultrasound_arrivals_.pop_front();
  wake_.notify_all();
}

void HeldVolumes::announced(const msg::Acquisition& acquisition, const ::ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  set_time(now);
  acquisitions_.announced(acquisition, Clock::now());
  wake_.notify_all();
}

void HeldVolumes::announced(const msg::CtInfo& ct) {
  const std::lock_guard<std::mutex> lock(mutex_);
  newest_ct_.announced(ct, Clock::now());
  wake_.notify_all();
}

void HeldVolumes::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    if (ct_arrival_) {
      const CtArrival arrival = *ct_arrival_;
      ct_arrival_.reset();
      converting_ct_ = true;
      lock.unlock();
      convert_ct(arrival);
      lock.lock();
    } else if (!ultrasound_arrivals_.empty()) {
      const UltrasoundArrival arrival = ultrasound_arrivals_.front();
      ultrasound_arrivals_.pop_front();
      lock.unlock();
      Entry entry = convert(arrival);
      lock.lock();
      converted_ultrasound_ = arrival.number;
      keep(std::move(entry));
    } else if (waits_for_tf()) {
      wake_.wait_for(lock, kPoll);
    } else {
      wake_.wait(lock);
    }
    settle_all();
    stillness_.judge();
    drop_old();
    lock.unlock();
    wake_.notify_all();
    changed_();
    lock.lock();
  }
}

/// Up to `ultrasound_volumes` volumes are settled, and about as many wait for tf. If volumes arrive
/// faster than tf, the newest replaces its predecessor; if the volumes that have waited longest
/// were dropped, none would ever be ready.
void HeldVolumes::keep(Entry entry) {
  const auto settled = [](const Entry& one) { return one.settled; };
  const auto most = static_cast<std::ptrdiff_t>(options_.ultrasound_volumes);
  const auto waiting = std::count_if(ultrasound_.begin(), ultrasound_.end(), std::not_fn(settled));
  if (!entry.settled && waiting > most && !ultrasound_.back().settled) ultrasound_.pop_back();
  ultrasound_.push_back(std::move(entry));
}

void HeldVolumes::drop_old() {
  const auto settled = [](const Entry& one) { return one.settled; };
  while (std::count_if(ultrasound_.begin(), ultrasound_.end(), settled) >
         static_cast<std::ptrdiff_t>(options_.ultrasound_volumes))
    ultrasound_.erase(std::find_if(ultrasound_.begin(), ultrasound_.end(), settled));
}

void HeldVolumes::convert_ct(const CtArrival& arrival) {
  const msg::CtVolume& message = *arrival.message;
  const std::string source = "CT revision " + std::to_string(message.revision);
  auto held = std::make_shared<HeldCt>();
  std::optional<Refusal> refusal = refusal_of([&] {
    require_header(message.header, arrival.now, source);
    *held = {message.header, arrival.epoch, message.revision, message.crc32,
             from_message(message, source)};
  });
  const std::lock_guard<std::mutex> lock(mutex_);
  converting_ct_ = false;
  // A CT that was loaded again, or sent by a node that was restarted, is no reason to refuse the
  // ultrasound that was acquired with it.
  if (!refusal && ct_ && has_same_voxels(*ct_, *held)) {
    held->header.stamp = ct_->header.stamp;
    held->epoch = ct_->epoch;
  }
  ct_ = refusal ? nullptr : held;
  ct_refusal_ = refusal;
}

HeldVolumes::Entry HeldVolumes::convert(const UltrasoundArrival& arrival) const {
  const msg::PreScanVolume& message = *arrival.message;
  const std::string source = "ultrasound with the stamp " + seconds_text(message.header.stamp);
  Entry entry;
  entry.number = arrival.number;
  entry.header = message.header;
  entry.refusal = refusal_of([&] {
    require_header(message.header, arrival.now, source);
    auto held = std::make_shared<HeldUltrasound>();
    held->header = message.header;
    held->epoch = arrival.epoch;
    held->frame_stamps = message.frame_stamps;
    held->beams = along_beams(from_message(message, source));
    held->tf_deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(options_.tf_timeout_s));
    entry.volume = held;
  });
  entry.settled = entry.refusal.has_value();
  return entry;
}

/// Looks the volume's pose up, and those of its frames, once tf has them or no time is left.
/// Returns whether it did.
bool HeldVolumes::settle(Entry& entry) {
  bool is_settled = true;
  entry.refusal = refusal_of([&] {
    HeldUltrasound& us = *entry.volume;
    is_settled = frame_.reaches(us.header) || Clock::now() >= us.tf_deadline;
    if (!is_settled) return;
    us.pose = frame_.look_up(us.header);
    us.sweep_motion_mm = frame_.compensate(us.header, us.pose, us.frame_stamps, us.beams.beams);
    us.still = stillness_.judgement_of(us.header, us.pose, us.tf_deadline);
  });
  if (entry.refusal && !may_come_later(*entry.refusal)) entry.volume.reset();
  return is_settled || entry.refusal;
}

void HeldVolumes::settle_all() {
  for (Entry& entry : ultrasound_)
    if (!entry.settled) entry.settled = settle(entry);
}

bool HeldVolumes::waits_for_tf() const {
  return stillness_.is_waiting() || std::any_of(ultrasound_.begin(), ultrasound_.end(),
                                                [](const Entry& entry) { return !entry.settled; });
}

void HeldVolumes::await(std::unique_lock<std::mutex>& lock, const std::function<bool()>& cancelled,
                        const std::function<bool()>& ready) {
  while (!ready()) {
    require_not(cancelled);
    wake_.wait_for(lock, kPoll);
  }
}

std::shared_ptr<const HeldCt> HeldVolumes::ct(const std::function<bool()>& cancelled) {
  std::unique_lock<std::mutex> lock(mutex_);
  std::optional<Refusal> lost;
  await(lock, cancelled, [&] {
    lost = newest_ct_.refusal(Clock::now());
    return lost || !is_ct_on_its_way();
  });
  if (lost) throw Refusal(*lost);
  if (ct_refusal_) throw Refusal(*ct_refusal_);
  if (!ct_) throw Refusal(Status::NO_CT, "no CT was received");
  return ct_;
}

HeldVolumes::Entry* HeldVolumes::find(const ::ros::Time& stamp) {
  const auto found = std::find_if(
      ultrasound_.rbegin(), ultrasound_.rend(),
      [&](const Entry& entry) { return stamp.isZero() || entry.header.stamp == stamp; });
  return found == ultrasound_.rend() ? nullptr : &*found;
}

void HeldVolumes::await_arrival(std::unique_lock<std::mutex>& lock, const ::ros::Time& stamp,
                                const std::function<bool()>& cancelled) {
  if (stamp.isZero()) return await_announced(lock, cancelled);
  const Clock::time_point deadline = Clock::now() + Acquisitions::kPatience;
  await(lock, cancelled,
        [&] { return !(acquisitions_.last_arrived() < stamp) || Clock::now() >= deadline; });
}

/// Sweeps that begin after the request do not prolong its wait.
void HeldVolumes::await_announced(std::unique_lock<std::mutex>& lock,
                                  const std::function<bool()>& cancelled) {
  const Clock::time_point asked = Clock::now();
  const std::optional<msg::Acquisition> awaited = acquisitions_.awaited(asked);
  if (!awaited) return;
  std::optional<Refusal> refusal;
  await(lock, cancelled, [&] {
    if (acquisitions_.has_ended(*awaited)) return true;
    refusal = acquisitions_.refusal(asked, Clock::now());
    return refusal.has_value();
  });
  if (refusal) throw Refusal(*refusal);
}

std::shared_ptr<const HeldUltrasound> HeldVolumes::ultrasound(
    const ::ros::Time& stamp, const std::function<bool()>& cancelled) {
  std::unique_lock<std::mutex> lock(mutex_);
  await_arrival(lock, stamp, cancelled);
  const std::uint64_t arrived = arrived_ultrasound_;
  await(lock, cancelled, [&] { return converted_ultrasound_ >= arrived; });
  Entry* entry = find(stamp);
  if (entry == nullptr) {
    if (ultrasound_.empty()) throw Refusal(Status::NO_ULTRASOUND, kNothingReceived);
    std::string held;
    for (const Entry& one : ultrasound_)
      held += (held.empty() ? "" : ", ") + seconds_text(one.header.stamp);
    throw Refusal(Status::NO_ULTRASOUND, "no ultrasound with the stamp " + seconds_text(stamp) +
                                             " is held; there is: " + held);
  }
  const std::uint64_t number = entry->number;
  // A volume that arrives during the wait may replace it.
  await(lock, cancelled, [&] {
    entry = &*std::find_if(ultrasound_.begin(), ultrasound_.end(),
                           [&](const Entry& one) { return one.number >= number; });
    return entry->settled;
  });
  if (!stamp.isZero() && entry->header.stamp != stamp)
    throw Refusal(Status::NO_ULTRASOUND,
                  "the ultrasound with the stamp " + seconds_text(stamp) +
                      " was given up for newer volumes while it waited for tf (volumes_kept)");
  // The converting thread then judges whether the probe stood still.
  if (entry->refusal && entry->volume && entry->volume->epoch.number == epoch_.number &&
      settle(*entry))
    wake_.notify_all();
  if (entry->refusal) throw UltrasoundRefusal(*entry->refusal, entry->header);
  return entry->volume;
}

bool HeldVolumes::require_still(const HeldUltrasound& us,
                                const std::function<bool()>& cancelled) const {
  while (us.still.wait_for(kPoll) != std::future_status::ready) require_not(cancelled);
  if (us.still.get()) return true;
  // tf may have come meanwhile.
  frame_.require_still(us.header, us.pose);
  return frame_.is_complete(us.header);
}

bool HeldVolumes::is_newest(const HeldCt& ct) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return newest_ct_.is(ct);
}

std::optional<CtIdentity> HeldVolumes::newest_ct() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!ct_ && !is_ct_on_its_way()) return std::nullopt;
  return newest_ct_.identity();
}

HeldVolumes::Ready HeldVolumes::ready_ultrasound() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!ct_ || is_ct_on_its_way()) return {};
  const auto found = std::find_if(ultrasound_.rbegin(), ultrasound_.rend(),
                                  [](const Entry& entry) { return entry.settled; });
  if (found == ultrasound_.rend()) return {};
  return {found->number, found->header.stamp};
}

HeldState HeldVolumes::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  HeldState state;
  state.ct = ct_;
  const std::optional<Refusal> lost = newest_ct_.refusal(Clock::now());
  state.ct_refusal = lost ? lost : ct_refusal_;
  state.ultrasound_volumes = static_cast<int>(ultrasound_.size());
  if (!ultrasound_.empty()) {
    state.newest_ultrasound = ultrasound_.back().header;
    state.newest_ultrasound_refusal = ultrasound_.back().refusal;
  }
  return state;
}

}  // namespace usct::ros_interface
