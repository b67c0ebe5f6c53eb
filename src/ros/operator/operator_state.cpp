#include "ros/operator/operator_state.h"

#include <us_ct_registration/StatusCode.h>

#include "ros/alignment/known_results.h"
#include "ros/conversions/alignment.h"
#include "ros/conversions/registration_result.h"
#include "ros/node/refusal.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/confidence_text.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Code = msg::StatusCode;

/// The core's result of a message; empty if the message is not valid.
std::optional<RegistrationResult> core_result(const msg::RegistrationResult& message) {
  try {
    return registration_result_from(message, "registration/result");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

void OperatorState::take_alignment(const msg::Alignment& message) {
  alignment_ = message;
  alignment_watch_.arrived(message);
}

void OperatorState::take_result(const msg::RegistrationResult& message) {
  // A person cancelled it and knows it; what counts or waits is as good as before.
  if (message.status.code == Code::CANCELLED) return;
  results_[message.id] = message;
  last_id_ = message.id;
  forget_old(results_, {alignment_.result_id, proposed_.result_id});
}

void OperatorState::set_requested(OperatorAction action, bool is_requested) {
  if (is_requested)
    requested_.insert(action);
  else
    requested_.erase(action);
}

bool OperatorState::is_requested(OperatorAction action) const {
  return requested_.count(action) > 0;
}

bool OperatorState::may(OperatorAction action) const {
  const bool is_deciding = is_requested(OperatorAction::kAccept) ||
                           is_requested(OperatorAction::kReject) ||
                           is_requested(OperatorAction::kRevert);
  switch (action) {
    case OperatorAction::kRegister:
      return !is_requested(OperatorAction::kRegister);
    case OperatorAction::kCancel:
      return (is_requested(OperatorAction::kRegister) || is_registering_) &&
             !is_requested(OperatorAction::kCancel);
    case OperatorAction::kAccept:
      return !is_deciding && is_proposed();
    case OperatorAction::kReject:
      return !is_deciding && (is_proposed() || proposed_.waiting_id != 0);
    case OperatorAction::kRevert:
      return !is_deciding && is_announced();
  }
  return false;
}

std::string OperatorState::in_force() const {
  if (!alignment_watch_.problem().empty()) return alignment_watch_.problem();
  return alignment_.message.empty() ? "nothing is known: tf_publisher has not been heard"
                                    : alignment_.message;
}

const msg::RegistrationResult* OperatorState::known(std::uint64_t id) const {
  const auto found = results_.find(id);
  return id == 0 || found == results_.end() ? nullptr : &found->second;
}

OperatorSubject OperatorState::about(PoseStanding standing, const std::string& headline,
                                     const msg::Alignment& alignment) const {
  const msg::RegistrationResult* message = known(alignment.result_id);
  if (message == nullptr) return {standing, headline, evidence_of(alignment, nullptr)};
  const std::optional<RegistrationResult> result = core_result(*message);
  // The message ends with the call that would accept the result.
  const std::string words =
      standing == PoseStanding::kWaiting ? "\n" + message->status.message : "";
  return {standing, headline + words, evidence_of(alignment, result ? &*result : nullptr)};
}

OperatorSubject OperatorState::subject() const {
  if (is_proposed())
    return about(PoseStanding::kWaiting, "WAITING: " + proposed_.message, proposed_);
  if (proposed_.waiting_id != 0)
    return {
        PoseStanding::kNone,
        "result " + std::to_string(proposed_.waiting_id) +
            " waits but cannot be accepted now: another CT is held, or the CT has another frame or "
            "hangs on another fixed frame. Reject it, or revert",
        ""};
  if (const msg::RegistrationResult* last = known(last_id_);
      last != nullptr && last->status.code != Code::REGISTERED) {
    const std::optional<RegistrationResult> result = core_result(*last);
    return {PoseStanding::kRefused,
            "REFUSED, " + code_name(last->status.code) + ": " + last->status.message,
            result ? confidence_text(*result) : ""};
  }
  if (is_announced() && !is_in_force())
    return {PoseStanding::kNone, "NO POSE: " + alignment_watch_.problem(), ""};
  if (is_in_force())
    return about(PoseStanding::kAccepted,
                 alignment_.state == msg::Alignment::RESTORED
                     ? "ACCEPTED before a restart: the patient may have moved since"
                     : "ACCEPTED: " + alignment_.message,
                 alignment_);
  return {PoseStanding::kNone, "nothing waits for a decision", ""};
}

}  // namespace usct::ros_interface
