#include "ros/registration/newest_ct.h"

#include <string>

namespace usct::ros_interface {

namespace msg = us_ct_registration;

void NewestCt::announced(const msg::CtInfo& info, Clock::time_point now) {
  awaited_ = Sent{info.revision, {info.header.frame_id, info.crc32}};
  heard_ = now;
  // The volume may have been quicker. A CT that is sent again need not be waited for either.
  if (arrived_ && arrived_->identity == awaited_->identity) awaited_.reset();
}

void NewestCt::arrived(const msg::CtVolume& volume, Clock::time_point now) {
  arrived_ = Sent{volume.revision, {volume.header.frame_id, volume.crc32}};
  if (!awaited_) return;
  const bool is_lost = now >= heard_ + patience_;
  if (arrived_->identity == awaited_->identity || is_lost) awaited_.reset();
}

std::optional<Refusal> NewestCt::refusal(Clock::time_point now) const {
  if (!awaited_ || now < heard_ + patience_) return std::nullopt;
  return Refusal(msg::StatusCode::NO_CT,
                 "CT revision " + std::to_string(awaited_->revision) +
                     " was announced, but has not arrived; a CT from before it may show another "
                     "patient");
}

std::optional<CtIdentity> NewestCt::identity() const {
  const std::optional<Sent>& newest = awaited_ ? awaited_ : arrived_;
  return newest ? std::optional(newest->identity) : std::nullopt;
}

bool NewestCt::is(const HeldCt& ct) const {
  return !awaited_ && arrived_ && arrived_->revision == ct.revision &&
         arrived_->identity == identity_of(ct);
}

}  // namespace usct::ros_interface
