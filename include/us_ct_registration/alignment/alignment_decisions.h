#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

/// Decisions about which registration counts as the alignment of the CT with the patient: results
/// are offered, accepted, rejected and reverted. Times are nanoseconds since 1970, of the wall
/// clock unless said otherwise.
namespace usct {

/// A pose in metres with a quaternion, unlike poses in the rest of the core. It is copied from a
/// result to the alignment's file and to the robot's transforms, which use these units, and must
/// keep every bit. Until it is set all numbers are 0, which is no valid rotation.
struct MetricPose {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation{0.0, 0.0, 0.0, 0.0};

  bool operator==(const MetricPose& other) const;
  /// Throws InputError, naming `source`, unless the pose is a rigid transform.
  void validate(const std::string& source) const;
};

/// Pose of the CT in a frame that stays with the patient.
struct Alignment {
  /// Names of the frame that stays with the patient and of the CT's frame.
  std::string fixed_frame;
  std::string ct_frame;
  /// `p_fixed = T_fixed_ct * p_ct`.
  MetricPose T_fixed_ct;
  /// Number of the registration's result; 0 if the alignment was restored.
  std::uint64_t result_id = 0;
  /// Checksum of the voxels of the CT for which the alignment holds.
  std::uint32_t ct_crc32 = 0;
  /// Acquisition time of the ultrasound, in the time of its stamps (which may be simulated).
  std::int64_t us_stamp_ns = 0;
  std::int64_t accepted_ns = 0;
  /// NaN if unknown.
  double expected_error_m = std::numeric_limits<double>::quiet_NaN();
  /// Covariance of the position of the CT's origin and of a rotation about it, both in the axes of
  /// the fixed frame: x, y, z, rotation about x, y, z; m^2, m rad, rad^2. All zero if unknown.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  /// Whether it was accepted before the program was started: the patient may have moved since.
  bool restored = false;

  /// Two errors that are unknown count as equal.
  bool operator==(const Alignment& other) const;
};

/// A registration's result that is offered for a decision.
struct OfferedResult {
  /// The alignment that counts once it is accepted; `result_id` is the result's number.
  Alignment alignment;
  bool registered = false;
  /// The reason why the result is no registration, in words.
  std::string message;
  /// Checksum of the whole result: a result that is sent again has the same digest.
  std::uint32_t digest = 0;
  /// The reason why a person has to decide even if results are accepted without one, in words;
  /// empty if there is none.
  std::string ask_because;
};

/// A CT's frame and the checksum of its voxels: both tell one CT from another.
using CtIdentity = std::pair<std::string, std::uint32_t>;

/// A source that shows which CT is held. The sources may disagree for a moment, or because one of
/// them has another CT.
enum class CtSource { kServer, kRegistration };

/// The state on disk: the alignment in force and the result that was decided last.
struct StoredAlignment {
  std::optional<Alignment> alignment;
  /// Digest of the last result that was accepted or rejected; 0: none. A result is sent again after
  /// a restart or a lost connection, and must not undo what was decided.
  std::uint32_t decided = 0;
  /// Why the alignment is suspended, in words; empty if it is not. A restart must not take it up
  /// again.
  std::string suspended_because;

  bool operator==(const StoredAlignment& other) const {
    return alignment == other.alignment && decided == other.decided &&
           suspended_because == other.suspended_because;
  }
};

/// Answer to a request. Any code but kDone means that nothing changed.
struct DecisionAnswer {
  enum class Code {
    kDone,
    kNotRegistered,    // the offered result is no registration
    kInvalidResult,    // names or numbers that must not be broadcast
    kInvalidRequest,   // another result waits, or the options forbid it
    kNothingToDecide,  // no result waits, or it was decided already
  };
  Code code = Code::kNothingToDecide;
  /// The answer in words, for people.
  std::string message;

  bool is_done() const { return code == Code::kDone; }
};

/// The state that is to be broadcast.
struct AlignmentState {
  /// The alignment to broadcast; empty if there is none.
  std::optional<Alignment> broadcast;
  /// The alignment that is broadcast, or the reason why there is none, in words.
  std::string message;
  /// Number of the result that waits for accept or reject; 0: none.
  std::uint64_t waiting_id = 0;
  /// The alignment that would be broadcast if a person accepted what waits: a result, or else the
  /// alignment from before the restart. Empty if nothing waits, or if it could not be accepted.
  std::optional<Alignment> proposed;
  /// Whether the alignment is suspended; see `AlignmentDecisions::suspend`.
  bool is_suspended = false;
};

/// Decides which alignment counts. It knows no clock and no disk; it is a plain value, so that a
/// change can be tried on a copy.
///
/// The CT's frame has one parent only: while an alignment counts, a result with another fixed frame
/// is refused. An alignment belongs to a CT (by its frame and the checksum of its voxels) and
/// is not in force while any source shows another CT, or the same one in another frame.
class AlignmentDecisions {
 public:
  /// Number of earlier alignments to which `revert` can return.
  static constexpr std::size_t kHistory = 10;

  struct Options {
    /// Results with another fixed frame are refused. If empty, any is taken until one counts.
    std::string fixed_frame;
    /// Whether results are accepted without a person.
    bool accept_at_once = false;
    /// Whether an alignment from before the restart counts as soon as its CT is held; else it
    /// counts only once a person accepts it.
    bool restore_at_once = false;
    /// An alignment that was accepted longer ago than this is not restored, s.
    double restore_max_age_s = 3600.0;
  };

  explicit AlignmentDecisions(const Options& options) : options_(options) {}

  /// Must be called before anything else. kInvalidRequest if the fixed frame is not the one of the
  /// options, kNothingToDecide if the alignment is too old.
  DecisionAnswer restore(const StoredAlignment& stored, std::int64_t now_ns);
  /// Sets the CT that a source shows.
  void hold_ct(CtSource source, const CtIdentity& ct, std::int64_t now_ns);
  /// Takes the alignment out of force for the reason in words, until a person accepts it again or
  /// another, or reverts to none, over restarts as well. Results that come meanwhile wait for a
  /// person.
  void suspend(const std::string& reason) { suspended_because_ = reason; }

  /// kDone: the result is accepted, or waits for a decision. Otherwise kNotRegistered,
  /// kInvalidResult, or kNothingToDecide if this very result was decided last.
  DecisionAnswer offer(const OfferedResult& result, std::int64_t now_ns);
  /// In place of the number of a result: the alignment that was kept from before the restart, or
  /// that is suspended. No result has this number, since numbers are times.
  static constexpr std::uint64_t kKept = 1;
  /// Accepts the result with this number; 0 accepts the one that waits, and nothing else: whoever
  /// decides about the kept alignment must not accept a result that has come meanwhile.
  DecisionAnswer accept(std::uint64_t result_id, std::int64_t now_ns);
  /// Drops what waits, by its number as in `accept`. An alignment that is suspended was accepted
  /// before, and is given up by `revert` alone.
  DecisionAnswer reject(std::uint64_t result_id);
  /// Returns to the previous alignment, or to none. The message says what is broadcast then, or why
  /// nothing is: the previous alignment may be of another CT, and a suspension goes on.
  DecisionAnswer revert();

  AlignmentState state() const;
  StoredAlignment stored() const { return {current_, decided_, suspended_because_}; }
  /// Number of alignments that `revert` can go back to.
  std::size_t history() const { return history_.size(); }

 private:
  bool restored_waits() const;
  /// How the alignment's CT differs from one that is held, in words that begin with "is"; empty if
  /// it does not.
  std::string differs_from_held(const Alignment& alignment) const;
  /// Why an alignment is too old to be restored, in words; empty if it is not.
  std::string outdated(const Alignment& alignment, std::int64_t now_ns) const;
  DecisionAnswer wrong_id(std::uint64_t result_id, const std::string& verb) const;
  std::string violation(const Alignment& alignment) const;
  DecisionAnswer accept_waiting(std::int64_t now_ns);
  DecisionAnswer accept_restored(std::int64_t now_ns);

  Options options_;
  std::map<CtSource, CtIdentity> held_cts_;
  std::optional<Alignment> current_;
  /// Whether the alignment from before the restart counts: its CT was shown, or a person accepted.
  bool restored_counts_ = false;
  std::string suspended_because_;
  std::optional<OfferedResult> waiting_;
  std::deque<Alignment> history_;
  std::uint32_t decided_ = 0;
};

}  // namespace usct
