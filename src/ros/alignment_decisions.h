#pragma once

#include <ros/time.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/RegistrationResult.h>
#include <us_ct_registration/StatusCode.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace usct::ros_interface {

/// What is kept on disk: the alignment that counts, and which result was decided last.
struct StoredAlignment {
  /// State ACCEPTED or RESTORED.
  std::optional<us_ct_registration::Alignment> alignment;
  /// Checksum of the message of the last result that was accepted or rejected: latched results come
  /// again after a restart or a lost connection, and must not undo what was decided. 0: none.
  std::uint32_t decided = 0;
};

/// Which alignment counts: results are offered, accepted, rejected and reverted. Knows no node, no
/// clock and no disk; a plain value, so that a change can be tried on a copy. Answers are codes
/// with a message; anything but OK changed nothing.
///
/// One parent only: while an alignment counts, one with another fixed frame is refused. An
/// alignment belongs to a CT (by the checksum of its voxels) and counts for nothing while another
/// is held.
class AlignmentDecisions {
 public:
  /// How many alignments `revert` can go back.
  static constexpr std::size_t kHistory = 10;

  struct Options {
    /// The only one that is taken; empty: any, until one counts.
    std::string fixed_frame;
    /// Whether results are accepted without a person.
    bool accept_at_once = false;
    /// Whether one from before the restart counts once its CT is held, or only when accepted.
    bool restore_at_once = true;
  };

  explicit AlignmentDecisions(const Options& options) : options_(options) {}

  /// Before anything else. INVALID_REQUEST if the fixed frame is not the configured one.
  us_ct_registration::StatusCode restore(const StoredAlignment& stored);
  /// The CT that is held now; 0: not known.
  void hold_ct(std::uint32_t ct_crc32) { held_ct_ = ct_crc32; }

  /// OK: accepted or waiting. Its own code if it is not REGISTERED. INVALID_MESSAGE: frames or
  /// numbers that must not reach tf. NOTHING_TO_DECIDE: the very message that was decided last.
  us_ct_registration::StatusCode offer(const us_ct_registration::RegistrationResult& result,
                                       const ::ros::Time& now);
  /// 0: the one that waits; without one, the alignment from before the restart.
  us_ct_registration::StatusCode accept(std::uint32_t result_id, const ::ros::Time& now);
  us_ct_registration::StatusCode reject(std::uint32_t result_id);
  /// To the alignment before, or to none.
  us_ct_registration::StatusCode revert();

  /// What to broadcast: state NONE and a message that says why, or the transform.
  us_ct_registration::Alignment alignment() const;
  StoredAlignment stored() const { return {current_, decided_}; }
  std::size_t history() const { return history_.size(); }

 private:
  struct Waiting {
    us_ct_registration::RegistrationResult result;
    std::uint32_t digest = 0;
  };

  bool restored_waits() const;
  bool is_held(std::uint32_t ct_crc32) const;
  bool is_other_than_held(std::uint32_t ct_crc32) const;
  us_ct_registration::StatusCode wrong_id(std::uint32_t result_id, const std::string& verb) const;
  std::string violation(const us_ct_registration::RegistrationResult& result) const;
  us_ct_registration::StatusCode accept_waiting(const ::ros::Time& now);
  us_ct_registration::StatusCode accept_restored();

  Options options_;
  std::uint32_t held_ct_ = 0;
  std::optional<us_ct_registration::Alignment> current_;
  /// A person said that the one from before the restart holds.
  bool restored_is_confirmed_ = false;
  std::optional<Waiting> waiting_;
  std::deque<us_ct_registration::Alignment> history_;
  std::uint32_t decided_ = 0;
};

}  // namespace usct::ros_interface
