#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>

/// Which registration counts as the alignment of the CT with the patient: results are offered,
/// accepted, rejected and reverted. Times are nanoseconds since 1970.
namespace usct {

/// A pose in metres and as a quaternion, unlike the rest of the core: it passes from a result to
/// the alignment's file and to the robot's transforms, which have these units, and no bit of it may
/// change on the way. All zero, which is no rotation, until it is set.
struct MetricPose {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation{0.0, 0.0, 0.0, 0.0};

  bool operator==(const MetricPose& other) const;
  /// Throws InputError, naming `source`, unless it is a rigid transform.
  void validate(const std::string& source) const;
};

/// Where the CT lies in what stays with the patient.
struct Alignment {
  /// Name of the frame that stays with the patient, and of the CT's.
  std::string fixed_frame;
  std::string ct_frame;
  /// `p_fixed = T_fixed_ct * p_ct`.
  MetricPose T_fixed_ct;
  /// Number of the registration's result; 0 if it was restored.
  std::uint32_t result_id = 0;
  /// Checksum of the voxels of the CT that it holds for; 0: not known.
  std::uint32_t ct_crc32 = 0;
  /// When the ultrasound was acquired.
  std::int64_t us_stamp_ns = 0;
  std::int64_t accepted_ns = 0;
  /// NaN: not known.
  double expected_error_m = std::numeric_limits<double>::quiet_NaN();
  /// Whether it was accepted before the program was started: the patient may have moved since.
  bool restored = false;

  /// Errors that are not known are equal.
  bool operator==(const Alignment& other) const;
};

/// A result of a registration, as it is offered.
struct OfferedResult {
  /// What would count if it was accepted; `result_id` is the result's number.
  Alignment alignment;
  bool registered = false;
  /// In words, why it is no registration.
  std::string message;
  /// Checksum of all that the result says: the same result that comes again has the same digest.
  std::uint32_t digest = 0;
};

/// The state on disk: the alignment in force, and the result that was decided last.
struct StoredAlignment {
  std::optional<Alignment> alignment;
  /// Digest of the last result that was accepted or rejected; 0: none. A result is sent again after
  /// a restart or a lost connection, and must not undo what was decided.
  std::uint32_t decided = 0;

  bool operator==(const StoredAlignment& other) const {
    return alignment == other.alignment && decided == other.decided;
  }
};

/// How a request was answered. Anything but kDone changed nothing.
struct DecisionAnswer {
  enum class Code {
    kDone,
    kNotRegistered,    // the offered result is no registration
    kInvalidResult,    // names or numbers that must not be broadcast
    kInvalidRequest,   // another result waits, or what was asked for contradicts the options
    kNothingToDecide,  // no result waits, or it was decided already
  };
  Code code = Code::kNothingToDecide;
  /// In words, for people.
  std::string message;

  bool is_done() const { return code == Code::kDone; }
};

/// What is to be broadcast.
struct AlignmentState {
  /// Empty: nothing.
  std::optional<Alignment> broadcast;
  /// In words: what is broadcast, or why nothing is.
  std::string message;
  /// Number of the result that waits for accept or reject; 0: none.
  std::uint32_t waiting_id = 0;
};

/// Decides which alignment counts. It knows no clock and no disk; it is a plain value, so that a
/// change can be tried on a copy.
///
/// The CT's frame has one parent only: while an alignment counts, a result with another fixed frame
/// is refused. An alignment belongs to a CT (by the checksum of its voxels) and counts for nothing
/// while another CT is held.
class AlignmentDecisions {
 public:
  /// Number of earlier alignments to which `revert` can return.
  static constexpr std::size_t kHistory = 10;

  struct Options {
    /// Results with another fixed frame are refused; empty: any, until one counts.
    std::string fixed_frame;
    /// Whether results are accepted without a person.
    bool accept_at_once = false;
    /// Whether an alignment from before the restart counts as soon as its CT is held; else it
    /// counts only once a person accepts it.
    bool restore_at_once = true;
  };

  explicit AlignmentDecisions(const Options& options) : options_(options) {}

  /// To be called before anything else. kInvalidRequest if the fixed frame is not the one of the
  /// options.
  DecisionAnswer restore(const StoredAlignment& stored);
  /// Says which CT is held now; 0: not known.
  void hold_ct(std::uint32_t ct_crc32) { held_ct_ = ct_crc32; }

  /// kDone: the result is accepted, or waits. kNotRegistered, kInvalidResult, or kNothingToDecide
  /// for the very result that was decided last.
  DecisionAnswer offer(const OfferedResult& result, std::int64_t now_ns);
  /// Accepts the result with this number; 0: the one that waits or, if none does, the alignment
  /// from before the restart.
  DecisionAnswer accept(std::uint32_t result_id, std::int64_t now_ns);
  DecisionAnswer reject(std::uint32_t result_id);
  /// Goes back to the alignment before, or to none.
  DecisionAnswer revert();

  AlignmentState state() const;
  StoredAlignment stored() const { return {current_, decided_}; }
  /// Number of alignments that `revert` can go back to.
  std::size_t history() const { return history_.size(); }

 private:
  bool restored_waits() const;
  bool is_held(std::uint32_t ct_crc32) const;
  bool is_other_than_held(std::uint32_t ct_crc32) const;
  DecisionAnswer wrong_id(std::uint32_t result_id, const std::string& verb) const;
  std::string violation(const Alignment& alignment) const;
  DecisionAnswer accept_waiting(std::int64_t now_ns);
  DecisionAnswer accept_restored();

  Options options_;
  std::uint32_t held_ct_ = 0;
  std::optional<Alignment> current_;
  /// Whether a person said that the alignment from before the restart holds.
  bool restored_is_confirmed_ = false;
  std::optional<OfferedResult> waiting_;
  std::deque<Alignment> history_;
  std::uint32_t decided_ = 0;
};

}  // namespace usct
