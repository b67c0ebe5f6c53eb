#include "ros/alignment_decisions.h"

#include <ros/serialization.h>
#include <zlib.h>

#include <limits>

#include "ros/conversions.h"
#include "ros/status.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

std::string named(std::uint32_t result_id) { return "result " + std::to_string(result_id); }

std::string named(const msg::Alignment& alignment) {
  return alignment.state == msg::Alignment::RESTORED ? "the alignment from before the restart"
                                                     : named(alignment.result_id);
}

std::uint32_t digest_of(msg::RegistrationResult result) {
  result.header.seq = 0;  // counts what was sent, not what was found
  const ::ros::SerializedMessage bytes = ::ros::serialization::serializeMessage(result);
  return static_cast<std::uint32_t>(crc32_z(0, bytes.buf.get(), bytes.num_bytes));
}

msg::Alignment alignment_from(const msg::RegistrationResult& result) {
  msg::Alignment alignment;
  alignment.header.stamp = result.header.stamp;
  alignment.header.frame_id = result.fixed_frame;
  alignment.state = msg::Alignment::ACCEPTED;
  alignment.ct_frame = result.ct_frame;
  alignment.transform = result.fixed_transform;
  alignment.result_id = result.id;
  alignment.ct_crc32 = result.ct_crc32;
  alignment.expected_error = result.expected_error;
  return alignment;
}

/// tf2 would refuse it at each broadcast.
bool is_frame_name(const std::string& name) { return !name.empty() && name.front() != '/'; }

}  // namespace

msg::StatusCode AlignmentDecisions::restore(const StoredAlignment& stored) {
  decided_ = stored.decided;
  if (!stored.alignment) return status(Code::OK, "no alignment to restore");
  const std::string& fixed_frame = stored.alignment->header.frame_id;
  if (!options_.fixed_frame.empty() && fixed_frame != options_.fixed_frame)
    return status(Code::INVALID_REQUEST, "the fixed frame of the stored alignment is '" +
                                             fixed_frame + "', must be '" + options_.fixed_frame +
                                             "'; it is not restored");
  current_ = stored.alignment;
  current_->state = msg::Alignment::RESTORED;
  current_->result_id = 0;
  return status(Code::OK, "restored");
}

std::string AlignmentDecisions::violation(const msg::RegistrationResult& result) const {
  if (result.id == 0) return "its 'id' is 0, must be >= 1";
  if (!is_frame_name(result.fixed_frame))
    return "its 'fixed_frame' is '" + result.fixed_frame + "', must be a frame without leading /";
  if (!is_frame_name(result.ct_frame))
    return "its 'ct_frame' is '" + result.ct_frame + "', must be a frame without leading /";
  if (result.fixed_frame == result.ct_frame)
    return "its fixed frame and its CT frame are both '" + result.ct_frame + "'";
  if (!options_.fixed_frame.empty() && result.fixed_frame != options_.fixed_frame)
    return "its fixed frame is '" + result.fixed_frame + "', must be '" + options_.fixed_frame +
           "', as parameter fixed_frame says";
  if (is_other_than_held(result.ct_crc32)) return "it is of another CT than the one that is held";
  if (current_ && !restored_waits() && result.fixed_frame != current_->header.frame_id)
    return "its fixed frame is '" + result.fixed_frame + "', but the CT hangs on '" +
           current_->header.frame_id + "' by " + named(*current_) +
           ", and a frame has one parent; revert to none first";
  try {
    from_message_mm(result.fixed_transform, "'fixed_transform'");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

msg::StatusCode AlignmentDecisions::offer(const msg::RegistrationResult& result,
                                          const ::ros::Time& now) {
  const std::string name = named(result.id);
  if (result.status.code != Code::REGISTERED)
    return status(result.status.code, name + " is no registration: " + result.status.message);
  const std::uint32_t digest = digest_of(result);
  if (digest == decided_)
    return status(Code::NOTHING_TO_DECIDE, name + " was decided already and came again");
  if (const std::string wrong = violation(result); !wrong.empty())
    return status(Code::INVALID_MESSAGE, name + " is refused: " + wrong);
  waiting_ = Waiting{result, digest};
  if (options_.accept_at_once) return accept_waiting(now);
  return status(Code::OK, name + " waits for accept or reject");
}

msg::StatusCode AlignmentDecisions::accept_waiting(const ::ros::Time& now) {
  // One that never counted is nothing to go back to.
  if (current_ && !restored_waits()) history_.push_back(*current_);
  if (history_.size() > kHistory) history_.pop_front();
  current_ = alignment_from(waiting_->result);
  current_->accepted = now;
  decided_ = waiting_->digest;
  waiting_.reset();
  return status(Code::OK, named(*current_) + " is accepted");
}

msg::StatusCode AlignmentDecisions::wrong_id(std::uint32_t result_id,
                                             const std::string& verb) const {
  const std::string asked = named(result_id) + " cannot be " + verb + ": ";
  if (waiting_) return status(Code::INVALID_REQUEST, asked + named(waiting_->result.id) + " waits");
  if (current_ && current_->result_id == result_id)
    return status(Code::NOTHING_TO_DECIDE, asked + "it is accepted already");
  return status(Code::NOTHING_TO_DECIDE, asked + "no result waits");
}

msg::StatusCode AlignmentDecisions::accept(std::uint32_t result_id, const ::ros::Time& now) {
  if (waiting_ && (result_id == 0 || result_id == waiting_->result.id)) {
    // The CT, or what it hangs on, may be others than when the result came.
    if (const std::string wrong = violation(waiting_->result); !wrong.empty())
      return status(Code::INVALID_REQUEST,
                    named(waiting_->result.id) + " cannot be accepted: " + wrong);
    return accept_waiting(now);
  }
  if (result_id == 0 && restored_waits()) return accept_restored();
  if (result_id != 0) return wrong_id(result_id, "accepted");
  return status(Code::NOTHING_TO_DECIDE, "no result waits for a decision");
}

msg::StatusCode AlignmentDecisions::accept_restored() {
  if (is_other_than_held(current_->ct_crc32))
    return status(Code::INVALID_REQUEST, named(*current_) +
                                             " cannot be accepted: it is of another " +
                                             "CT than the one that is held");
  restored_is_confirmed_ = true;
  return status(Code::OK, named(*current_) + " is accepted");
}

msg::StatusCode AlignmentDecisions::reject(std::uint32_t result_id) {
  if (waiting_ && (result_id == 0 || result_id == waiting_->result.id)) {
    const std::string name = named(waiting_->result.id);
    decided_ = waiting_->digest;
    waiting_.reset();
    return status(Code::OK, name + " is rejected");
  }
  if (result_id == 0 && restored_waits()) {
    const std::string name = named(*current_);
    current_.reset();
    return status(Code::OK, name + " is rejected");
  }
  if (result_id != 0) return wrong_id(result_id, "rejected");
  return status(Code::NOTHING_TO_DECIDE, "no result waits for a decision");
}

msg::StatusCode AlignmentDecisions::revert() {
  if (!current_) return status(Code::NOTHING_TO_DECIDE, "no alignment is accepted");
  const std::string left = named(*current_) + " is given up: ";
  current_.reset();
  if (history_.empty()) return status(Code::OK, left + "nothing is broadcast any more");
  current_ = history_.back();
  history_.pop_back();
  return status(Code::OK, left + "back to " + named(*current_));
}

bool AlignmentDecisions::is_held(std::uint32_t ct_crc32) const {
  return held_ct_ != 0 && ct_crc32 == held_ct_;
}

bool AlignmentDecisions::is_other_than_held(std::uint32_t ct_crc32) const {
  return held_ct_ != 0 && ct_crc32 != 0 && ct_crc32 != held_ct_;
}

bool AlignmentDecisions::restored_waits() const {
  if (!current_ || current_->state != msg::Alignment::RESTORED || restored_is_confirmed_)
    return false;
  return !(options_.restore_at_once && is_held(current_->ct_crc32));
}

msg::Alignment AlignmentDecisions::alignment() const {
  msg::Alignment answer;
  answer.expected_error = std::numeric_limits<double>::quiet_NaN();
  if (!current_) {
    answer.message = "nothing is accepted";
  } else if (is_other_than_held(current_->ct_crc32)) {
    answer.message = named(*current_) + " is of another CT than the one that is held";
  } else if (restored_waits()) {
    answer.message = named(*current_) + " waits for " +
                     (options_.restore_at_once && held_ct_ == 0 ? "its CT or " : "") + "accept";
  } else {
    answer = *current_;
    answer.message = named(*current_) + " is broadcast";
  }
  answer.waiting_id = waiting_ ? waiting_->result.id : 0;
  return answer;
}

}  // namespace usct::ros_interface
