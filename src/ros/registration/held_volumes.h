#pragma once

#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanVolume.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ros/node/refusal.h"
#include "ros/registration/acquisitions.h"
#include "ros/registration/held_images.h"
#include "ros/registration/newest_ct.h"
#include "ros/registration/stillness_watch.h"
#include "ros/tf/fixed_frame.h"

namespace usct::ros_interface {

/// The refusal of a volume that is held.
class UltrasoundRefusal : public Refusal {
 public:
  UltrasoundRefusal(const Refusal& refusal, std_msgs::Header header)
      : Refusal(refusal), header_(std::move(header)) {}

  /// That of the volume.
  const std_msgs::Header& header() const { return header_; }

 private:
  std_msgs::Header header_;
};

/// The message of NO_ULTRASOUND where nothing was announced either.
constexpr const char* kNothingReceived = "no ultrasound was received";

/// A summary of the held volumes, for diagnostics.
struct HeldState {
  std::shared_ptr<const HeldCt> ct;
  std::optional<Refusal> ct_refusal;
  int ultrasound_volumes = 0;
  std::optional<std_msgs::Header> newest_ultrasound;
  std::optional<Refusal> newest_ultrasound_refusal;
};

struct HeldVolumesOptions {
  /// Number of recent ultrasound volumes that are kept; >= 1.
  int ultrasound_volumes = 3;
  /// Longest wait until tf reaches the stamp of an ultrasound volume, wall time.
  double tf_timeout_s = 1.0;
  /// How long the volume of a CT that was announced may be on its way: a large one takes seconds on
  /// a network.
  double ct_patience_s = 30.0;
};

/// Holds the newest CT and some recent ultrasound volumes, converted, with poses in the fixed
/// frame. Callbacks only hand messages over; a thread of this class converts each of them once.
///
/// A caller who asks for a volume waits until all messages that have arrived are converted, so that
/// no older volume is registered in place of the newest. If the newest message is malformed, the
/// caller is refused with that reason. May be called from any thread.
class HeldVolumes {
 public:
  /// Calls `changed`, from the converting thread, whenever a volume may have become available.
  HeldVolumes(const FixedFrame& frame, HeldVolumesOptions options, std::function<void()> changed);
  ~HeldVolumes();
  HeldVolumes(const HeldVolumes&) = delete;
  HeldVolumes& operator=(const HeldVolumes&) = delete;

  /// `now` is the node's clock. A message whose stamp is far ahead of it is refused.
  void arrived(const us_ct_registration::CtVolume::ConstPtr& message, const ::ros::Time& now);
  void arrived(const us_ct_registration::PreScanVolume::ConstPtr& message, const ::ros::Time& now);
  /// Ultrasound is being recorded, is on its way, or was refused.
  void announced(const us_ct_registration::Acquisition& acquisition, const ::ros::Time& now);
  /// A CT is on its way.
  void announced(const us_ct_registration::CtInfo& ct);
  /// Must be called often, so that a jump of the clock back is noticed.
  void notice_time(const ::ros::Time& now);

  /// The newest CT. Waits for it, up to `ct_patience_s` after it was announced; `cancelled` ends
  /// the wait with the refusal CANCELLED. Refuses with NO_CT or INVALID_MESSAGE.
  std::shared_ptr<const HeldCt> ct(const std::function<bool()>& cancelled);
  /// The ultrasound with this stamp; 0: the newest. Waits like `ct`, and up to 2 s for a volume
  /// that is named and newer than all that have arrived, or, if the newest is asked for, for one
  /// that was announced before (see Acquisitions). Refuses with NO_ULTRASOUND, INVALID_MESSAGE or,
  /// for want of its pose, TF_UNAVAILABLE, TF_STALE or TF_JUMPED.
  std::shared_ptr<const HeldUltrasound> ultrasound(const ::ros::Time& stamp,
                                                   const std::function<bool()>& cancelled);

  /// Waits until tf has reached the end of the window in which the probe must not move, or for
  /// `tf_timeout`: a registration may begin before that, but its result must not be given out. The
  /// probe was judged then, and tf may have forgotten the volume's time since. Returns whether tf
  /// has reached the end of the window, so that a motion would have been seen. Refuses with
  /// TF_JUMPED, TF_UNAVAILABLE or CANCELLED.
  bool require_still(const HeldUltrasound& us, const std::function<bool()>& cancelled) const;

  /// Whether no other CT was announced or has arrived since `ct`, converted or not.
  bool is_newest(const HeldCt& ct) const;
  /// The CT that `ct` returns or waits for; empty if there is none.
  std::optional<CtIdentity> newest_ct() const;
  /// The newest ultrasound that can be registered without waiting, for it or for the CT; `number`
  /// counts up, 0: none.
  struct Ready {
    std::uint64_t number = 0;
    ::ros::Time stamp;
  };
  Ready ready_ultrasound() const;
  HeldState state() const;

 private:
  using Clock = std::chrono::steady_clock;
  /// A volume, or the reason why it is refused. Until it is settled, the volume waits for tf; one
  /// that is refused for want of tf is kept, and looked up again when it is asked for.
  struct Entry {
    std::uint64_t number = 0;
    std_msgs::Header header;
    std::shared_ptr<HeldUltrasound> volume;
    std::optional<Refusal> refusal;
    bool settled = false;
  };

  /// A message, and the clock when it arrived.
  template <typename Message>
  struct Arrival {
    boost::shared_ptr<const Message> message;
    ::ros::Time now;
    ClockEpoch epoch;
    std::uint64_t number = 0;  // of ultrasound, in the order of arrival
  };
  using CtArrival = Arrival<us_ct_registration::CtVolume>;
  using UltrasoundArrival = Arrival<us_ct_registration::PreScanVolume>;

  void set_time(const ::ros::Time& now);
  void work();
  void convert_ct(const CtArrival& arrival);
  Entry convert(const UltrasoundArrival& arrival) const;
  void keep(Entry entry);
  void drop_old();
  bool settle(Entry& entry);
  void settle_all();
  bool waits_for_tf() const;
  bool is_ct_on_its_way() const { return newest_ct_.is_awaited() || ct_arrival_ || converting_ct_; }
  void await_arrival(std::unique_lock<std::mutex>& lock, const ::ros::Time& stamp,
                     const std::function<bool()>& cancelled);
  void await_announced(std::unique_lock<std::mutex>& lock, const std::function<bool()>& cancelled);
  Entry* find(const ::ros::Time& stamp);
  void await(std::unique_lock<std::mutex>& lock, const std::function<bool()>& cancelled,
             const std::function<bool()>& ready);

  const FixedFrame& frame_;
  StillnessWatch stillness_{frame_};
  const HeldVolumesOptions options_;
  const std::function<void()> changed_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  ::ros::Time last_now_;
  ClockEpoch epoch_;
  std::optional<CtArrival> ct_arrival_;
  bool converting_ct_ = false;
  std::deque<UltrasoundArrival> ultrasound_arrivals_;
  std::uint64_t arrived_ultrasound_ = 0;    // number of the last that arrived
  Acquisitions acquisitions_;               // of this epoch
  std::uint64_t converted_ultrasound_ = 0;  // number of the last that was converted
  NewestCt newest_ct_;
  std::shared_ptr<const HeldCt> ct_;
  std::optional<Refusal> ct_refusal_;
  std::deque<Entry> ultrasound_;  // newest last

  std::thread worker_;
};

}  // namespace usct::ros_interface
