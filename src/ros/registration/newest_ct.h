#pragma once

#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/CtVolume.h>

#include <chrono>
#include <cstdint>
#include <optional>

#include "ros/node/refusal.h"
#include "ros/registration/held_images.h"
#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct::ros_interface {

/// Which CT is the newest: the one that was announced, or else the one whose volume arrived last. A
/// volume takes seconds, and a request that comes meanwhile would get the CT before, which may be
/// another patient's. Announcements and volumes come by two topics, in any order; a volume need not
/// be announced.
///
/// CTs are told apart by their identity, so that it does not matter that two senders count their
/// revisions differently, or that the clock was set back. Not thread-safe.
class NewestCt {
 public:
  using Clock = std::chrono::steady_clock;

  /// `patience`: how long a volume may be on its way.
  explicit NewestCt(std::chrono::duration<double> patience)
      : patience_(std::chrono::duration_cast<Clock::duration>(patience)) {}

  void announced(const us_ct_registration::CtInfo& info, Clock::time_point now);
  void arrived(const us_ct_registration::CtVolume& volume, Clock::time_point now);

  /// Whether a CT was announced that is another one than the one that arrived last.
  bool is_awaited() const { return awaited_.has_value(); }
  /// Why a request waits for it no longer; empty if it does, or if none is awaited.
  std::optional<Refusal> refusal(Clock::time_point now) const;

  /// Empty until a CT is announced or arrives.
  std::optional<CtIdentity> identity() const;
  /// Whether since this CT none has arrived, and no other one was announced.
  bool is(const HeldCt& ct) const;

 private:
  struct Sent {
    std::uint32_t revision = 0;
    CtIdentity identity;
  };

  const Clock::duration patience_;
  std::optional<Sent> awaited_;
  Clock::time_point heard_;  // when it was announced
  std::optional<Sent> arrived_;
};

}  // namespace usct::ros_interface
