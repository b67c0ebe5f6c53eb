#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/streamed_frame.h"

namespace usct {

struct AssemblyOptions {
  /// A sweep ends when no frame has arrived for this long.
  double sweep_pause_s = 1.0;
  /// Largest share of a sweep's frames that may be missing.
  double max_missing = 0.1;
  /// Most frames, and most bytes of brightness, of a sweep; larger sweeps are refused.
  int max_frames = 2000;
  std::size_t max_bytes = std::size_t{1} << 30;
  /// An image stamped t shows what the probe saw at t - lag.
  double image_lag_s = 0.0;
};

/// Numbers of frames by the reason why they are not in a volume.
using Counts = std::map<std::string, std::uint64_t>;
/// The counts in words, like "2 missing, 1 late"; empty if there are none.
std::string counted(const Counts& counts);

/// A volume and the frames that it was assembled from.
struct AssembledSweep {
  PreScanVolume volume;
  /// Name of the US frame.
  std::string us_frame_id;
  /// Acquisition time of each frame of the volume: its stamp minus the image lag, nanoseconds since
  /// 1970.
  std::vector<std::int64_t> stamps_ns;
  /// The frames of the volume, as they were given to the assembler.
  std::vector<std::shared_ptr<const StreamedFrame>> frames;
};

/// A sweep that has ended.
struct EndedSweep {
  std::uint32_t number = 0;
  /// The acquisition time of the newest frame that was taken: its stamp minus the image lag. 0 if
  /// time ran back.
  std::int64_t newest_ns = 0;
  /// Empty if the sweep was refused.
  std::optional<AssembledSweep> assembled;
  /// Reason why the sweep was refused; else the frames that were dropped, or empty.
  std::string message;
};

/// Assembles streamed frames to volumes. Times are nanoseconds since 1970.
///
/// A sweep ends with its last frame if it says how many it has, with the first frame of another
/// number, or by a pause. Frames are sorted by index. The assembler drops, and counts by reason:
/// invalid frames; frames of a sweep that has ended ("late"); a second frame with the same index;
/// an image that equals the one before while the probe moved (captured video repeats frames; a
/// blank image is no repetition); a motorised frame at the angle of the one before (the motor
/// rests); tracked frames whose pose at the stamp minus the lag is not known. Indices that never
/// came and frames without a pose count as missing.
///
/// A frame that continues a sweep, by its number and stamp, which a pause has ended makes the
/// assembler refuse that sweep after all, once.
///
/// A sweep is refused, with the reason, if more than `max_missing` of it are missing, if it exceeds
/// the limits, if geometry, sizes, frame names or the motor's travel change within it, if stamps
/// fall or if the motor turns back.
///
/// If the lag is 0, every number of a volume equals that of its frames, bit by bit.
class SweepAssembler {
 public:
  explicit SweepAssembler(const AssemblyOptions& options);

  /// Takes a frame that arrived at `now_ns` and returns the sweeps that ended with it. When time
  /// runs backwards (a recording that starts again), the open sweep is refused, and the assembler
  /// forgets those that have ended.
  std::vector<EndedSweep> add(const std::shared_ptr<const StreamedFrame>& frame,
                              std::int64_t now_ns);
  /// Counts a frame that could not even be read, because of `problem`, as an invalid one.
  std::vector<EndedSweep> add_invalid(const std::string& problem, std::int64_t now_ns);
  /// Returns the sweep that a pause has ended.
  std::vector<EndedSweep> end_after_pause(std::int64_t now_ns);

  /// The sweep that has not ended, like "sweep 3, 12 frames"; empty if there is none.
  std::string open_sweep() const;
  /// The same: how many have begun so far, and the acquisition time of its first frame.
  struct OpenSweep {
    std::uint64_t number = 0;
    std::int64_t since_ns = 0;
  };
  std::optional<OpenSweep> recording() const;
  std::uint64_t received() const { return received_; }
  /// Frames that were dropped or are missing, by reason.
  const Counts& dropped() const { return dropped_; }
  /// The fault of the last invalid frame, or the reason why the last frame without a pose had none.
  const std::string& last_problem() const { return last_problem_; }

 private:
  using Frame = std::shared_ptr<const StreamedFrame>;
  struct Sweep {
    Frame first;
    std::map<std::uint32_t, Frame> frames;  // by index
    std::size_t bytes = 0;
    std::size_t without_pose = 0;
    std::string pose_problem;
    std::int64_t newest_stamp_ns = 0;
  };
  struct Ended {
    std::uint32_t number;
    bool had_first_index;
    std::int64_t newest_stamp_ns;
    bool by_pause;
  };

  std::vector<EndedSweep> arrived(std::int64_t now_ns);
  void count_invalid(const std::string& problem);
  void take(const Frame& frame, std::vector<EndedSweep>& ended);
  /// The sweep of a frame that is late: one that has ended, and that the sender goes on with. Null
  /// if there is none, or if the sender uses its number again.
  Ended* ended_sweep_of(const StreamedFrame& frame);
  /// Refuses a sweep that a pause has ended before this frame of it came.
  void tell_torn(Ended& of, const StreamedFrame& frame, std::vector<EndedSweep>& ended) const;
  bool is_of_this_sweep(const StreamedFrame& frame) const;
  bool starts_anew(const StreamedFrame& frame) const;
  std::string refusal_of(const StreamedFrame& frame) const;
  void store(const Frame& frame);
  bool is_complete() const;
  /// The stamp minus the image lag.
  std::int64_t acquired_ns(std::int64_t stamp_ns) const;
  EndedSweep end(const std::string& refusal = {});
  void assemble(const Sweep& sweep, EndedSweep& result);
  void require_few_missing(const Sweep& sweep, Counts& dropped, const std::string& source) const;
  void drop(const std::string& reason, std::uint64_t count = 1);

  AssemblyOptions options_;
  std::optional<Sweep> sweep_;
  std::deque<Ended> ended_;
  std::int64_t last_arrival_ns_ = 0;
  std::uint64_t received_ = 0;
  std::uint64_t begun_ = 0;
  Counts dropped_;
  std::string last_problem_;
};

}  // namespace usct
