#include "us_ct_registration/alignment/alignment_decisions.h"

#include <cmath>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

using Code = DecisionAnswer::Code;

std::string named(std::uint64_t result_id) { return "result " + std::to_string(result_id); }

std::string named(const Alignment& alignment) {
  return alignment.restored ? "the alignment from before the restart" : named(alignment.result_id);
}

/// Names with a leading slash would be refused at each broadcast.
bool is_frame_name(const std::string& name) { return !name.empty() && name.front() != '/'; }

bool same_or_unknown(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

std::string seconds(double value) { return std::to_string(std::llround(value)) + " s"; }

}  // namespace

bool MetricPose::operator==(const MetricPose& other) const {
  return translation_m == other.translation_m && rotation.coeffs() == other.rotation.coeffs();
}

void MetricPose::validate(const std::string& source) const {
  rigid_from_quaternion(rotation, translation_m, source);
}

bool Alignment::operator==(const Alignment& other) const {
  return fixed_frame == other.fixed_frame && ct_frame == other.ct_frame &&
         T_fixed_ct == other.T_fixed_ct && result_id == other.result_id &&
         ct_crc32 == other.ct_crc32 && us_stamp_ns == other.us_stamp_ns &&
         accepted_ns == other.accepted_ns && restored == other.restored &&
         covariance == other.covariance &&
         same_or_unknown(expected_error_m, other.expected_error_m);
}

std::string AlignmentDecisions::outdated(const Alignment& alignment, std::int64_t now_ns) const {
  constexpr double kSecondsPerNs = 1e-9;
  const double age_s = kSecondsPerNs * static_cast<double>(now_ns - alignment.accepted_ns);
  if (age_s >= 0.0 && age_s <= options_.restore_max_age_s) return "";
  if (age_s < 0.0)
    return "was accepted " + seconds(-age_s) + " from now, by this machine's clock: register again";
  return "was accepted " + seconds(age_s) +
         " ago, must be at most restore_max_age = " + seconds(options_.restore_max_age_s) +
         ": register again";
}

DecisionAnswer AlignmentDecisions::restore(const StoredAlignment& stored, std::int64_t now_ns) {
  decided_ = stored.decided;
  if (!stored.alignment) return {Code::kDone, "no alignment to restore"};
  const std::string& fixed_frame = stored.alignment->fixed_frame;
  if (!options_.fixed_frame.empty() && fixed_frame != options_.fixed_frame)
    return {Code::kInvalidRequest, "the fixed frame of the stored alignment is '" + fixed_frame +
                                       "', must be '" + options_.fixed_frame +
                                       "'; it is not restored"};
  if (const std::string reason = outdated(*stored.alignment, now_ns); !reason.empty())
    return {Code::kNothingToDecide, "the stored alignment is not restored: it " + reason};
  current_ = stored.alignment;
  current_->restored = true;
  current_->result_id = 0;
  suspended_because_ = stored.suspended_because;
  return {Code::kDone, "restored"};
}

void AlignmentDecisions::hold_ct(CtSource source, const CtIdentity& ct, std::int64_t now_ns) {
  held_cts_[source] = ct;
  if (options_.restore_at_once && restored_waits() && differs_from_held(*current_).empty() &&
      outdated(*current_, now_ns).empty())
    restored_counts_ = true;
}

std::string AlignmentDecisions::violation(const Alignment& alignment) const {
  if (alignment.result_id == 0) return "its 'id' is 0, must be >= 1";
  if (!is_frame_name(alignment.fixed_frame))
    return "its 'fixed_frame' is '" + alignment.fixed_frame +
           "', must be a frame without leading /";
  if (!is_frame_name(alignment.ct_frame))
    return "its 'ct_frame' is '" + alignment.ct_frame + "', must be a frame without leading /";
  if (alignment.fixed_frame == alignment.ct_frame)
    return "its fixed frame and its CT frame are both '" + alignment.ct_frame + "'";
  if (!options_.fixed_frame.empty() && alignment.fixed_frame != options_.fixed_frame)
    return "its fixed frame is '" + alignment.fixed_frame + "', must be '" + options_.fixed_frame +
           "', as parameter fixed_frame says";
  if (alignment.ct_crc32 == 0) return "its 'ct_crc32' is 0, must be the checksum of its CT";
  if (const std::string other = differs_from_held(alignment); !other.empty()) return "it " + other;
  if (current_ && !restored_waits() && alignment.fixed_frame != current_->fixed_frame)
    return "its fixed frame is '" + alignment.fixed_frame + "', but the CT hangs on '" +
           current_->fixed_frame + "' by " + named(*current_) +
           ", and a frame has one parent; revert to none first";
  try {
    alignment.T_fixed_ct.validate("'fixed_transform'");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

DecisionAnswer AlignmentDecisions::offer(const OfferedResult& result, std::int64_t now_ns) {
  const std::string name = named(result.alignment.result_id);
  if (!result.registered)
    return {Code::kNotRegistered, name + " is no registration: " + result.message};
  if (result.digest == decided_)
    return {Code::kNothingToDecide, name + " was decided already and came again"};
  if (const std::string wrong = violation(result.alignment); !wrong.empty())
    return {Code::kInvalidResult, name + " is refused: " + wrong};
  waiting_ = result;
  const std::string& because = suspended_because_.empty() ? result.ask_because : suspended_because_;
  if (options_.accept_at_once && because.empty()) return accept_waiting(now_ns);
  return {Code::kDone,
          name + " waits for accept or reject" + (options_.accept_at_once ? ": " + because : "")};
}

DecisionAnswer AlignmentDecisions::accept_waiting(std::int64_t now_ns) {
  // An alignment that never counted is no state to revert to.
  if (current_ && !restored_waits()) history_.push_back(*current_);
  if (history_.size() > kHistory) history_.pop_front();
  current_ = waiting_->alignment;
  current_->accepted_ns = now_ns;
  decided_ = waiting_->digest;
  waiting_.reset();
  suspended_because_.clear();
  return {Code::kDone, named(*current_) + " is accepted"};
}

DecisionAnswer AlignmentDecisions::wrong_id(std::uint64_t result_id,
                                            const std::string& verb) const {
  if (result_id == 0) {
    const bool is_kept = restored_waits() || (current_ && !suspended_because_.empty());
    return {Code::kNothingToDecide,
            "no result waits for a decision" +
                (is_kept ? "; 1 stands for " + named(*current_) : std::string())};
  }
  // `accept` takes up a suspended alignment, so that this is a `reject`.
  if (result_id == kKept && current_ && !suspended_because_.empty())
    return {Code::kNothingToDecide, named(*current_) + " cannot be " + verb +
                                        ": it was accepted, and is suspended; revert gives it up"};
  if (result_id == kKept)
    return {Code::kNothingToDecide,
            "no alignment is kept from before a restart, and none is suspended"};
  const std::string asked = named(result_id) + " cannot be " + verb + ": ";
  if (waiting_)
    return {Code::kInvalidRequest, asked + named(waiting_->alignment.result_id) + " waits"};
  if (current_ && current_->result_id == result_id)
    return {Code::kNothingToDecide, asked + "it is accepted already"};
  return {Code::kNothingToDecide, asked + "no result waits"};
}

DecisionAnswer AlignmentDecisions::accept(std::uint64_t result_id, std::int64_t now_ns) {
  if (waiting_ && (result_id == 0 || result_id == waiting_->alignment.result_id)) {
    // The CT that is held, or the parent of its frame, may have changed since the result came.
    if (const std::string wrong = violation(waiting_->alignment); !wrong.empty())
      return {Code::kInvalidRequest,
              named(waiting_->alignment.result_id) + " cannot be accepted: " + wrong};
    return accept_waiting(now_ns);
  }
  if (result_id == kKept && restored_waits()) return accept_restored(now_ns);
  if (current_ && !suspended_because_.empty() &&
      (result_id == kKept || (result_id != 0 && result_id == current_->result_id))) {
    if (const std::string other = differs_from_held(*current_); !other.empty())
      return {Code::kInvalidRequest, named(*current_) + " cannot be accepted: it " + other};
    suspended_because_.clear();
    return {Code::kDone, named(*current_) + " is in force again"};
  }
  return wrong_id(result_id, "accepted");
}

DecisionAnswer AlignmentDecisions::accept_restored(std::int64_t now_ns) {
  if (const std::string other = differs_from_held(*current_); !other.empty())
    return {Code::kInvalidRequest, named(*current_) + " cannot be accepted: it " + other};
  if (const std::string reason = outdated(*current_, now_ns); !reason.empty())
    return {Code::kInvalidRequest, named(*current_) + " cannot be accepted: it " + reason};
  restored_counts_ = true;
  current_->accepted_ns = now_ns;
  suspended_because_.clear();
  return {Code::kDone, named(*current_) + " is accepted"};
}

DecisionAnswer AlignmentDecisions::reject(std::uint64_t result_id) {
  if (waiting_ && (result_id == 0 || result_id == waiting_->alignment.result_id)) {
    const std::string name = named(waiting_->alignment.result_id);
    decided_ = waiting_->digest;
    waiting_.reset();
    return {Code::kDone, name + " is rejected"};
  }
  if (result_id == kKept && restored_waits()) {
    const std::string name = named(*current_);
    current_.reset();
    suspended_because_.clear();
    return {Code::kDone, name + " is rejected"};
  }
  return wrong_id(result_id, "rejected");
}

DecisionAnswer AlignmentDecisions::revert() {
  if (!current_) return {Code::kNothingToDecide, "no alignment is accepted"};
  const std::string left = named(*current_) + " is given up: ";
  current_.reset();
  if (history_.empty()) {
    suspended_because_.clear();
  } else {
    current_ = history_.back();
    history_.pop_back();
  }
  // The previous alignment may be of another CT, or suspended.
  return {Code::kDone, left + state().message};
}

std::string AlignmentDecisions::differs_from_held(const Alignment& alignment) const {
  for (const auto& [source, held] : held_cts_)
    if (held.second != alignment.ct_crc32) return "is of another CT than the one that is held";
  for (const auto& [source, held] : held_cts_)
    if (held.first != alignment.ct_frame)
      return "is of the CT in frame '" + alignment.ct_frame +
             "', but the one that is held is in frame '" + held.first + "'";
  return "";
}

bool AlignmentDecisions::restored_waits() const {
  return current_ && current_->restored && !restored_counts_;
}

AlignmentState AlignmentDecisions::state() const {
  AlignmentState state;
  if (!current_) {
    state.message = "nothing is accepted";
  } else if (const std::string other = differs_from_held(*current_); !other.empty()) {
    state.message = named(*current_) + " " + other;
  } else if (!suspended_because_.empty()) {
    state.message = named(*current_) + " is suspended: " + suspended_because_;
  } else if (restored_waits()) {
    state.message = named(*current_) + " waits for " +
                    (options_.restore_at_once && held_cts_.empty() ? "its CT or " : "") + "accept";
  } else {
    state.broadcast = current_;
    state.message = named(*current_) + " is broadcast";
  }
  state.waiting_id = waiting_ ? waiting_->alignment.result_id : 0;
  if (waiting_) {
    if (violation(waiting_->alignment).empty()) state.proposed = waiting_->alignment;
  } else if (restored_waits() && differs_from_held(*current_).empty()) {
    state.proposed = current_;
  }
  state.is_suspended = !suspended_because_.empty();
  return state;
}

}  // namespace usct
