#pragma once

#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/DecideRequest.h>
#include <us_ct_registration/RegistrationResult.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "ros/alignment/alignment_watch.h"
#include "us_ct_registration/rendering/fusion_view.h"

namespace usct::ros_interface {

/// What a person who registers and decides may ask for.
enum class OperatorAction { kRegister, kCancel, kAccept, kReject, kRevert };

/// The registration that a person should look at now, in words.
struct OperatorSubject {
  PoseStanding standing = PoseStanding::kNone;
  /// The decision, and the message of the result.
  std::string headline;
  /// The evidence, in lines; empty if there is none.
  std::string evidence;
};

/// Follows the topics of registration and tf_publisher, and tf, and says what a person may do and
/// should see. It knows neither ROS's network nor a window. Not synchronised.
class OperatorState {
 public:
  void take_alignment(const us_ct_registration::Alignment& message);
  void take_proposed(const us_ct_registration::Alignment& message) { proposed_ = message; }
  void take_result(const us_ct_registration::RegistrationResult& message);
  /// Looks the announced alignment up in tf, as AlignmentWatch.
  void look_up(const TfBuffer& tf, const ::ros::Time& now,
               AlignmentWatch::Clock::time_point wall_now) {
    alignment_watch_.look_up(tf, now, wall_now);
  }
  /// Sets whether an own request of this kind waits for its answer.
  void set_requested(OperatorAction action, bool is_requested);
  /// Sets whether the registration node says that it registers, for whomever.
  void set_registering(bool is_registering) { is_registering_ = is_registering; }

  bool may(OperatorAction action) const;
  const us_ct_registration::Alignment& alignment() const { return alignment_; }
  /// The CT as the alignment places it; empty if none is announced.
  const std::optional<AlignedCt>& aligned() const { return alignment_watch_.aligned(); }
  /// The alignment that counts, or why none does, in words.
  std::string in_force() const;
  /// The result whose alignment counts; null if none counts, or its result is not known.
  const us_ct_registration::RegistrationResult* result_in_force() const {
    return is_in_force() ? known(alignment_.result_id) : nullptr;
  }
  /// Whether tf_publisher says that an alignment counts.
  bool is_announced() const { return alignment_.state != us_ct_registration::Alignment::NONE; }
  /// Whether tf has it as well, as AlignmentWatch knows it.
  bool is_in_force() const { return is_announced() && alignment_watch_.problem().empty(); }
  /// What waits for a decision; else the last registration if it was refused; else what counts.
  OperatorSubject subject() const;
  /// The number by which `subject` is accepted or rejected; 0: nothing waits.
  std::uint64_t subject_id() const {
    return is_proposed() && proposed_.waiting_id == 0 ? +us_ct_registration::DecideRequest::KEPT
                                                      : proposed_.waiting_id;
  }
  /// Whether tf_publisher accepts results by itself; false until it was heard.
  bool is_automatic() const { return proposed_.policy == "auto"; }

 private:
  bool is_requested(OperatorAction action) const;
  bool is_proposed() const { return proposed_.state == us_ct_registration::Alignment::PROPOSED; }
  /// Null if the result is not known.
  const us_ct_registration::RegistrationResult* known(std::uint64_t id) const;
  OperatorSubject about(PoseStanding standing, const std::string& headline,
                        const us_ct_registration::Alignment& alignment) const;

  us_ct_registration::Alignment alignment_;
  AlignmentWatch alignment_watch_;
  us_ct_registration::Alignment proposed_;
  /// The newest results by their ids.
  std::map<std::uint64_t, us_ct_registration::RegistrationResult> results_;
  std::uint64_t last_id_ = 0;
  std::set<OperatorAction> requested_;
  bool is_registering_ = false;
};

}  // namespace usct::ros_interface
