#include "ros/alignment/alignment_diagnosis.h"

#include <ros/time.h>

#include "ros/conversions/alignment.h"
#include "ros/conversions/times.h"

namespace usct::ros_interface {
namespace {

using diagnostic_msgs::DiagnosticStatus;

const char* name_of(const AlignmentState& state) {
  if (!state.broadcast) return "none";
  return state.broadcast->restored ? "restored" : "accepted";
}

/// Why nothing is right, in words; empty if all is.
std::string error_of(const AlignmentState& state, const std::string& file_error) {
  if (state.is_suspended) return state.message;
  // A launch with a bag leaves /use_sim_time true on a master that goes on to run.
  if (state.broadcast && ::ros::Time::now().isZero())
    return "nothing is broadcast: /use_sim_time is true, and no time comes on /clock";
  return file_error.empty() ? "" : "alignment_file: " + file_error;
}

void add_ages(const Alignment& alignment, diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.add("age of the ultrasound (s)",
             seconds_between(time_from(alignment.us_stamp_ns), ::ros::Time::now()));
  constexpr double kSecondsPerNs = 1e-9;
  const auto now_ns = static_cast<std::int64_t>(::ros::WallTime::now().toNSec());
  status.add("accepted since (s)",
             kSecondsPerNs * static_cast<double>(now_ns - alignment.accepted_ns));
}

}  // namespace

void describe(const AlignmentDecisions& decisions, const std::string& last_refusal,
              const std::string& file_error, diagnostic_updater::DiagnosticStatusWrapper& status) {
  const AlignmentState state = decisions.state();
  const Alignment alignment = state.broadcast.value_or(Alignment());
  const bool is_held_back = !state.broadcast && decisions.stored().alignment;
  const bool is_attention =
      alignment.restored || is_held_back || state.waiting_id != 0 || !last_refusal.empty();
  if (const std::string error = error_of(state, file_error); !error.empty())
    status.summary(DiagnosticStatus::ERROR, error);
  else
    status.summary(is_attention ? DiagnosticStatus::WARN : DiagnosticStatus::OK,
                   state.message +
                       (state.waiting_id == 0 ? "" : "; " + to_proposed_message(state).message) +
                       (last_refusal.empty() ? "" : "; refused: " + last_refusal));
  status.add("state", name_of(state));
  status.add("fixed frame", alignment.fixed_frame);
  status.add("CT frame", alignment.ct_frame);
  if (state.broadcast) {
    add_ages(alignment, status);
    status.add("expected error (mm)", 1000.0 * alignment.expected_error_m);
  }
  status.add("result", alignment.result_id);
  status.add("waiting result", state.waiting_id);
  status.add("alignments to go back to", decisions.history());
  status.add("last refusal", last_refusal);
}

}  // namespace usct::ros_interface
