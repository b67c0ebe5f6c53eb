#include "us_ct_registration/ultrasound/sweep_assembly.h"

#include <algorithm>

#include "ultrasound/nanoseconds.h"
#include "ultrasound/sweep_volume.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr const char* kMissing = "missing";
constexpr const char* kWithoutPose = "without pose";
constexpr const char* kOfRefusedSweep = "of a refused sweep";
/// A clock that is set back by no more goes on.
constexpr double kLeastRunBack_s = 0.1;
/// Number of ended sweeps that are remembered, to recognise their late frames.
constexpr std::size_t kRememberedSweeps = 16;

std::string name_of_sweep(const StreamedFrame& frame) {
  return "sweep " + std::to_string(frame.sweep);
}

/// The name of the US frame, if the sender states it with each frame.
std::string sent_us_frame(const StreamedFrame& frame) {
  return frame.pose && frame.pose->at_stamp ? frame.pose->us_frame_id : "";
}

bool same_probe(const StreamedFrame& a, const StreamedFrame& b) {
  const auto radius_mm = [](const Array& array) {
    const auto* curved = std::get_if<CurvilinearArray>(&array);
    return curved != nullptr ? curved->probe_radius_mm : 0.0;
  };
  const auto motor_radius_mm = [](const StreamedFrame& frame) {
    return frame.motor ? frame.motor->motor_radius_mm : 0.0;
  };
  return a.array.index() == b.array.index() && a.is_motorised() == b.is_motorised() &&
         radius_mm(a.array) == radius_mm(b.array) && line_table(a.array) == line_table(b.array) &&
         motor_radius_mm(a) == motor_radius_mm(b) &&
         a.axial.start_depth_mm == b.axial.start_depth_mm &&
         a.axial.spacing_mm == b.axial.spacing_mm;
}

}  // namespace

std::string counted(const Counts& counts) {
  std::string text;
  for (const auto& [reason, count] : counts)
    text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + reason;
  return text;
}

SweepAssembler::SweepAssembler(const AssemblyOptions& options) : options_(options) {}

void SweepAssembler::drop(const std::string& reason, std::uint64_t count) {
  dropped_[reason] += count;
}

std::vector<EndedSweep> SweepAssembler::end_after_pause(std::int64_t now_ns) {
  if (!sweep_ || seconds_from(now_ns - last_arrival_ns_) <= options_.sweep_pause_s) return {};
  std::vector<EndedSweep> ended;
  ended.push_back(end());
  ended_.back().by_pause = true;
  return ended;
}

std::string SweepAssembler::open_sweep() const {
  if (!sweep_) return "";
  return name_of_sweep(*sweep_->first) + ", " + std::to_string(sweep_->frames.size()) + " frames";
}

std::int64_t SweepAssembler::acquired_ns(std::int64_t stamp_ns) const {
  return stamp_ns - nanoseconds_from(options_.image_lag_s);
}

std::optional<SweepAssembler::OpenSweep> SweepAssembler::recording() const {
  if (!sweep_) return std::nullopt;
  return OpenSweep{begun_, acquired_ns(sweep_->first->stamp_ns)};
}

std::vector<EndedSweep> SweepAssembler::arrived(std::int64_t now_ns) {
  ++received_;
  std::vector<EndedSweep> ended;
  if (seconds_from(last_arrival_ns_ - now_ns) > kLeastRunBack_s) {
    if (sweep_) ended.push_back(end("time ran back while it was recorded"));
    for (EndedSweep& sweep : ended) sweep.newest_ns = 0;  // a time that is to come
    ended_.clear();
  } else {
    ended = end_after_pause(now_ns);
  }
  last_arrival_ns_ = now_ns;
  return ended;
}

void SweepAssembler::count_invalid(const std::string& problem) {
  drop("invalid");
  last_problem_ = problem;
}

std::vector<EndedSweep> SweepAssembler::add_invalid(const std::string& problem,
                                                    std::int64_t now_ns) {
  std::vector<EndedSweep> ended = arrived(now_ns);
  count_invalid(problem);
  return ended;
}

std::vector<EndedSweep> SweepAssembler::add(const Frame& frame, std::int64_t now_ns) {
  std::vector<EndedSweep> ended = arrived(now_ns);
  try {
    frame->validate(options_.image_lag_s);
  } catch (const InputError& error) {
    count_invalid(error.what());
    return ended;
  }
  take(frame, ended);
  return ended;
}

bool SweepAssembler::is_of_this_sweep(const StreamedFrame& frame) const {
  return sweep_ && frame.sweep == sweep_->first->sweep;
}

/// A sender that was restarted counts from 0 again. The same frame sent twice has the same stamp.
bool SweepAssembler::starts_anew(const StreamedFrame& frame) const {
  return is_of_this_sweep(frame) && frame.index == 0 && sweep_->frames.count(0) > 0 &&
         frame.stamp_ns > sweep_->newest_stamp_ns;
}

void SweepAssembler::take(const Frame& frame, std::vector<EndedSweep>& ended) {
  if (Ended* of = is_of_this_sweep(*frame) ? nullptr : ended_sweep_of(*frame)) {
    drop("late");
    tell_torn(*of, *frame, ended);
    of->newest_stamp_ns = std::max(of->newest_stamp_ns, frame->stamp_ns);
    return;
  }
  const bool anew = starts_anew(*frame);
  if (sweep_ && (!is_of_this_sweep(*frame) || anew)) {
    ended.push_back(end());
    // The frames that follow belong to a new sweep with the same number, and are not late.
    if (anew) ended_.pop_back();
  }
  if (!sweep_) {
    sweep_ = Sweep();
    sweep_->first = frame;
    sweep_->newest_stamp_ns = frame->stamp_ns;
    ++begun_;
  }
  const std::string refusal = refusal_of(*frame);
  if (!refusal.empty()) {
    drop(kOfRefusedSweep);
    ended.push_back(end(refusal));
    return;
  }
  store(frame);
  if (is_complete()) ended.push_back(end());
}

SweepAssembler::Ended* SweepAssembler::ended_sweep_of(const StreamedFrame& frame) {
  const auto ended = std::find_if(ended_.begin(), ended_.end(),
                                  [&](const Ended& e) { return e.number == frame.sweep; });
  if (ended == ended_.end()) return nullptr;
  // A sender that was restarted may use the number again, from the first index on, which may be
  // lost if the sender has paused.
  const bool is_newer = frame.stamp_ns > ended->newest_stamp_ns;
  const bool has_paused =
      seconds_from(frame.stamp_ns - ended->newest_stamp_ns) > options_.sweep_pause_s;
  const bool anew = has_paused || (frame.index == 0 && (ended->had_first_index || is_newer));
  if (!anew) return &*ended;
  ended_.erase(ended);
  return nullptr;
}

void SweepAssembler::tell_torn(Ended& of, const StreamedFrame& frame,
                               std::vector<EndedSweep>& ended) const {
  if (!of.by_pause || frame.stamp_ns <= of.newest_stamp_ns) return;
  of.by_pause = false;  // once is enough
  EndedSweep torn;
  torn.number = of.number;
  torn.newest_ns = acquired_ns(frame.stamp_ns);
  torn.message = name_of_sweep(frame) + ": frame " + std::to_string(frame.index) +
                 " came after a pause of more than " + std::to_string(options_.sweep_pause_s) +
                 " s (sweep_pause) had ended it, so that its volume lacks this frame and those "
                 "after it: acquire the sweep again";
  ended.push_back(std::move(torn));
}

std::string SweepAssembler::refusal_of(const StreamedFrame& frame) const {
  const StreamedFrame& first = *sweep_->first;
  const std::string at = " at frame " + std::to_string(frame.index);
  if (!same_probe(frame, first)) return "the geometry of the probe changes" + at;
  if (frame.axial.samples != first.axial.samples)
    return "the size changes" + at + " from " + std::to_string(first.axial.samples) + " x " +
           std::to_string(line_count(first.array)) + " to " + std::to_string(frame.axial.samples) +
           " x " + std::to_string(line_count(frame.array));
  if (frame.frames_in_sweep != first.frames_in_sweep)
    return "'frames_in_sweep' changes" + at + " from " + std::to_string(first.frames_in_sweep) +
           " to " + std::to_string(frame.frames_in_sweep);
  if (frame.frame_id != first.frame_id || sent_us_frame(frame) != sent_us_frame(first))
    return "'frame_id' or 'pose_frame_id' changes" + at;
  const auto most = static_cast<std::uint32_t>(options_.max_frames);
  if (frame.frames_in_sweep > most || frame.index >= most)
    return "it has " +
           std::to_string(std::max<std::uint64_t>(frame.frames_in_sweep, frame.index + 1ULL)) +
           " frames at least, max_frames is " + std::to_string(most);
  if (sweep_->bytes + frame.brightness->size() > options_.max_bytes)
    return "it is larger than " + std::to_string(options_.max_bytes) + " bytes (max_volume_mb)";
  return {};
}

void SweepAssembler::store(const Frame& frame) {
  if (!sweep_->frames.emplace(frame->index, frame).second) {
    drop("same index");
    return;
  }
  sweep_->bytes += frame->brightness->size();
  sweep_->newest_stamp_ns = std::max(sweep_->newest_stamp_ns, frame->stamp_ns);
  if (!frame->is_motorised() && !frame->pose) {
    ++sweep_->without_pose;
    sweep_->pose_problem = frame->pose_problem;
    last_problem_ = frame->name() + ": no pose: " + frame->pose_problem;
  }
}

bool SweepAssembler::is_complete() const {
  return sweep_->frames.size() == sweep_->first->frames_in_sweep;
}

EndedSweep SweepAssembler::end(const std::string& refusal) {
  const Sweep sweep = std::move(*sweep_);
  sweep_.reset();
  EndedSweep result;
  result.number = sweep.first->sweep;
  result.newest_ns = acquired_ns(sweep.newest_stamp_ns);
  ended_.push_back({result.number, sweep.frames.count(0) > 0, sweep.newest_stamp_ns, false});
  if (ended_.size() > kRememberedSweeps) ended_.pop_front();
  if (refusal.empty()) {
    assemble(sweep, result);
  } else {
    drop(kOfRefusedSweep, sweep.frames.size());
    result.message = name_of_sweep(*sweep.first) + ": " + refusal;
  }
  return result;
}

void SweepAssembler::assemble(const Sweep& sweep, EndedSweep& result) {
  const std::string source = name_of_sweep(*sweep.first);
  Counts dropped;
  try {
    require_few_missing(sweep, dropped, source);
    std::vector<Frame> frames;
    for (const auto& [index, frame] : sweep.frames) frames.push_back(frame);
    result.assembled = volume_of_sweep(frames, options_.image_lag_s, source, dropped);
    result.message = counted(dropped);
  } catch (const InputError& error) {
    drop(kOfRefusedSweep, sweep.frames.size());
    result.message = error.what();
  }
  for (const auto& [reason, count] : dropped) drop(reason, count);
}

void SweepAssembler::require_few_missing(const Sweep& sweep, Counts& dropped,
                                         const std::string& source) const {
  const std::size_t expected = sweep.first->frames_in_sweep > 0
                                   ? sweep.first->frames_in_sweep
                                   : std::size_t{sweep.frames.rbegin()->first} + 1;
  const std::size_t missing = expected - sweep.frames.size();
  if (missing > 0) dropped[kMissing] = missing;
  if (sweep.without_pose > 0) dropped[kWithoutPose] = sweep.without_pose;
  const std::size_t lost = missing + sweep.without_pose;
  if (static_cast<double>(lost) <= options_.max_missing * static_cast<double>(expected)) return;
  const std::string poses = sweep.without_pose == 0
                                ? std::string()
                                : ", " + std::to_string(sweep.without_pose) +
                                      " of them for want of a pose (" + sweep.pose_problem + ")";
  throw InputError(source, std::to_string(lost) + " of " + std::to_string(expected) +
                               " frames are missing" + poses + "; max_missing is " +
                               std::to_string(options_.max_missing));
}

}  // namespace usct
