#include "ultrasound/exclusion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "large_pages.h"
#include "parallel.h"
#include "require.h"
#include "ultrasound/depth_profiles.h"
#include "ultrasound/frames_in_air.h"
#include "ultrasound/gaussian_sums.h"

namespace usct {
namespace {

constexpr double kSpeckleSigmaMm = 1.5;
constexpr double kRobustDeviations = 3.0;
constexpr double kMadToDeviation = 1.4826;
constexpr double kNearFieldChange = 0.2;
constexpr double kDarkShare = 0.9;
constexpr int kWallNeighbours = 4;  // lines and frames to either side of a beam
constexpr float kConstantGrey = 1.0F;
constexpr std::size_t kParts = 4;

/// Reorders the values.
template <typename Value>
Value in_place_median(std::vector<Value>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class Exclusion {
 public:
  Exclusion(const BeamUltrasound& ultrasound, const ConditioningOptions& options,
            ConditionedUltrasound& result)
      : us_(ultrasound),
        options_(options),
        result_(result),
        axial_(ultrasound.beams.axial),
        samples_(ultrasound.beams.samples()),
        beams_(static_cast<int>(ultrasound.beams.beams.size())),
        known_(ultrasound.known.empty() ? nullptr : ultrasound.known.data()),
        soft_(ultrasound.brightness.size()) {}

  void run() {
    result_.reasons.assign(us_.brightness.size(), 0);
    smooth();
    if (options_.no_contact_share > 0.0) air_ = frames_in_air(us_);
    profiles_ =
        depth_profiles(soft_.data(), soft_.size(), air_.empty() ? us_.known : known_outside_air(),
                       static_cast<std::size_t>(samples_));
    find_depths();
    find_far_wall();
    judge_depths();
    for_frames([&](int first, int last) {
      std::vector<int> judged;
      for (int beam = first; beam < last; ++beam) mark(beam, judged);
    });
  }

 private:
  std::size_t at(int beam, int sample) const {
    return static_cast<std::size_t>(beam) * static_cast<std::size_t>(samples_) +
           static_cast<std::size_t>(sample);
  }
  bool is_known(std::size_t i) const { return known_ == nullptr || known_[i] != 0; }

  /// Calls `body(first, last)` for the beams of each frame, in parallel.
  template <typename Body>
  void for_frames(const Body& body) const {
    const int lines = us_.beams.lines;
    parallel_for(us_.beams.frames, [&](int frame) { body(frame * lines, (frame + 1) * lines); });
  }
  template <typename Body>
  void for_beams(const Body& body) const {
    for_frames([&](int first, int last) {
      for (int beam = first; beam < last; ++beam) body(beam);
    });
  }

  /// The known samples of the frames with contact. A sweep that is recorded before the probe
  /// touches may have more frames in air than not, which would be the usual ones.
  std::vector<std::uint8_t> known_outside_air() const {
    std::vector<std::uint8_t> known = us_.known;
    known.resize(soft_.size(), 1);
    for (int frame = 0; frame < us_.beams.frames; ++frame)
      if (is_in_air(frame * us_.beams.lines))
        std::fill_n(known.begin() + static_cast<std::ptrdiff_t>(at(frame * us_.beams.lines, 0)),
                    us_.beams.lines * samples_, 0);
    return known;
  }

  bool is_in_air(int beam) const {
    return !air_.empty() && air_[static_cast<std::size_t>(beam / us_.beams.lines)] != 0;
  }

  /// Averages speckle over the known samples.
  void smooth() {
    const auto fill = [&](int frame, int line, float* const* rows) {
      const std::size_t start = us_.beams.offset(frame, line);
      for (std::size_t s = 0; s < static_cast<std::size_t>(samples_); ++s) {
        const bool known = is_known(start + s);
        rows[0][s] = known ? us_.brightness[start + s] : 0.0F;
        rows[1][s] = known ? 1.0F : 0.0F;
      }
    };
    const auto divide = [&](int frame, int line, const float* const* sums) {
      const std::size_t start = us_.beams.offset(frame, line);
      for (std::size_t s = 0; s < static_cast<std::size_t>(samples_); ++s) {
        const float mean = sums[0][s] / sums[1][s];
        soft_[start + s] = is_known(start + s) ? mean : 0.0F;
      }
    };
    GaussianSums(us_.beams, kSpeckleSigmaMm)(2, fill, divide);
  }

  void find_depths() {
    const DepthOptions& depth = options_.depth;
    const double first_mm = axial_.depth_mm(0);
    const double last_mm = axial_.depth_mm(samples_ - 1);
    result_.min_depth_mm = depth.min_mm.value_or(depth.automatic ? near_field_end_mm() : first_mm);
    result_.max_depth_mm = depth.max_mm.value_or(last_mm);
    if (std::max(result_.min_depth_mm, first_mm) > std::min(result_.max_depth_mm, last_mm))
      throw InputError("depth range", std::to_string(result_.min_depth_mm) + " to " +
                                          std::to_string(result_.max_depth_mm) +
                                          " mm holds no sample, must meet the lines' " +
                                          std::to_string(first_mm) + " to " +
                                          std::to_string(last_mm) + " mm");
  }

  double near_field_end_mm() const {
    std::vector<double> inner;
    for (int s = samples_ / 4; s <= samples_ * 3 / 4; ++s)
      if (std::isfinite(profiles_.mean[static_cast<std::size_t>(s)]))
        inner.push_back(profiles_.mean[static_cast<std::size_t>(s)]);
    const int third = samples_ / 3;
    const double third_mm = axial_.depth_mm(third);
    double end_mm = std::min(options_.depth.near_field_mm, third_mm);
    if (inner.empty()) return end_mm;
    const double level = in_place_median(inner);
    for (double& value : inner) value = std::abs(value - level);
    const double tolerance = std::max(kRobustDeviations * kMadToDeviation * in_place_median(inner),
                                      kNearFieldChange * std::abs(level));
    const double limit_mm = std::min(options_.depth.near_field_limit_mm, third_mm);
    for (int s = 0; s < samples_ && axial_.depth_mm(s) <= limit_mm; ++s)
      if (std::abs(profiles_.mean[static_cast<std::size_t>(s)] - level) > tolerance)
        end_mm = std::max(end_mm, axial_.depth_mm(s + 1));
    return end_mm;
  }

  /// Finds, for each beam, the first sample at or beyond the far wall; `samples_` if there is none.
  void find_far_wall() {
    wall_.assign(static_cast<std::size_t>(beams_), samples_);
    const std::optional<double>& least_share = options_.depth.far_wall_share;
    if (options_.depth.max_mm || !options_.depth.automatic || !least_share) return;
    const double grey = wall_grey();
    std::vector<int> found(wall_.size());
    for_beams([&](int beam) { found[static_cast<std::size_t>(beam)] = bright_echo(beam, grey); });
    if (std::all_of(found.begin(), found.end(), [&](int s) { return s == samples_; })) return;
    for_beams(
        [&](int beam) { wall_[static_cast<std::size_t>(beam)] = median_around(found, beam); });
    result_.far_wall_share = far_wall_share();
    if (result_.far_wall_share >= *least_share) return;
    result_.far_wall_share = 0.0;
    std::fill(wall_.begin(), wall_.end(), samples_);
  }

  /// The share of the beams outside air that end at a far wall.
  double far_wall_share() const {
    double with_wall = 0.0;
    double in_contact = 0.0;
    for (int beam = 0; beam < beams_; ++beam) {
      if (is_in_air(beam)) continue;
      with_wall += wall_[static_cast<std::size_t>(beam)] < samples_ ? 1.0 : 0.0;
      in_contact += 1.0;
    }
    return in_contact > 0.0 ? with_wall / in_contact : 0.0;
  }

  /// The grey value that only a far wall exceeds: that of the brightest sample in the nearer half.
  /// It is the same sample however the scanner displays brightness, and fat behind a kidney is not
  /// brighter than fat in front of it.
  double wall_grey() const {
    const int half = samples_ / 2;
    int first = 0;
    while (first < half && axial_.depth_mm(first) < result_.min_depth_mm) ++first;
    if (first == half) return std::numeric_limits<double>::infinity();  // nothing to compare with
    std::vector<float> brightest(static_cast<std::size_t>(us_.beams.frames));
    for_frames([&](int first_beam, int last_beam) {
      float most = 0.0F;
      for (int beam = first_beam; beam < last_beam && !is_in_air(beam); ++beam)
        for (int s = first; s < half; ++s) most = std::max(most, soft_[at(beam, s)]);
      brightest[static_cast<std::size_t>(first_beam / us_.beams.lines)] = most;
    });
    return std::max<double>(*std::max_element(brightest.begin(), brightest.end()),
                            options_.visible_grey);
  }

  int bright_echo(int beam, double wall_grey) const {
    for (int s = samples_ / 2; s < samples_; ++s)
      if (is_known(at(beam, s)) && soft_[at(beam, s)] > wall_grey)
        return std::max(
            0, s - static_cast<int>(options_.depth.far_wall_margin_mm / axial_.spacing_mm));
    return samples_;
  }

  int median_around(const std::vector<int>& found, int beam) const {
    const int lines = us_.beams.lines;
    const int line = beam % lines;
    const int frame = beam / lines;
    std::vector<int> values;
    constexpr std::size_t kAcross = 2 * kWallNeighbours + 1;
    values.reserve(kAcross * kAcross);
    for (int f = std::max(0, frame - kWallNeighbours);
         f <= std::min(us_.beams.frames - 1, frame + kWallNeighbours); ++f)
      for (int l = std::max(0, line - kWallNeighbours);
           l <= std::min(lines - 1, line + kWallNeighbours); ++l)
        values.push_back(found[us_.beams.beam_number(f, l)]);
    return in_place_median(values);
  }

  /// Finds the depths that are excluded, or too dark to judge, for all beams alike.
  void judge_depths() {
    visible_.resize(profiles_.median.size());
    outside_.resize(profiles_.median.size());
    for (std::size_t s = 0; s < profiles_.median.size(); ++s) {
      const double depth_mm = axial_.depth_mm(static_cast<int>(s));
      const bool inside = depth_mm >= result_.min_depth_mm && depth_mm <= result_.max_depth_mm;
      outside_[s] = inside ? 0 : kOutsideDepth;
      visible_[s] = inside && profiles_.median[s] >= options_.visible_grey ? 1 : 0;
    }
  }

  bool is_constant(int beam) const {
    float low = std::numeric_limits<float>::max();
    float high = std::numeric_limits<float>::lowest();
    for (int s = 0; s < samples_ && high - low <= kConstantGrey; ++s) {
      if (!is_known(at(beam, s))) continue;
      low = std::min(low, us_.brightness[at(beam, s)]);
      high = std::max(high, us_.brightness[at(beam, s)]);
    }
    return high - low <= kConstantGrey;
  }

  /// Finds the samples by which contact and shadow of a beam are judged.
  void find_judged(int beam, std::vector<int>& judged) const {
    const int end = std::min(samples_, wall_[static_cast<std::size_t>(beam)]);
    judged.resize(static_cast<std::size_t>(end));
    std::size_t count = 0;
    for (int s = 0; s < end; ++s) {
      judged[count] = s;
      count += visible_[static_cast<std::size_t>(s)] != 0 && is_known(at(beam, s)) ? 1 : 0;
    }
    judged.resize(count);
  }

  /// Whether the beam is dark in every quarter of the judged samples. A beam that ends at a rib is
  /// not: tissue in front of the rib is bright in the first quarter.
  bool is_dark(int beam, const std::vector<int>& judged) const {
    if (judged.size() < kParts) return false;
    for (std::size_t part = 0; part < kParts; ++part) {
      double sum = 0.0;
      double usual_sum = 0.0;
      for (std::size_t i = part * judged.size() / kParts; i < (part + 1) * judged.size() / kParts;
           ++i) {
        sum += soft_[at(beam, judged[i])];
        usual_sum += profiles_.median[static_cast<std::size_t>(judged[i])];
      }
      if (sum >= options_.no_contact_share * usual_sum) return false;
    }
    return true;
  }

  /// The first sample of the dark end of a line, of which at least `kDarkShare` is dark (the rest
  /// is noise); `samples_` if there is none.
  int shadow_start(int beam, const std::vector<int>& judged) const {
    // With more bright samples than this no longer end is dark.
    const double most_bright = (1.0 - kDarkShare) * static_cast<double>(judged.size()) + 1.0;
    int start = samples_;
    int shadow = 0;
    int seen = 0;
    int dark = 0;
    for (std::size_t i = judged.size(); i-- > 0 && seen - dark <= most_bright;) {
      const int s = judged[i];
      ++seen;
      if (soft_[at(beam, s)] >=
          options_.shadow_share * profiles_.median[static_cast<std::size_t>(s)])
        continue;
      ++dark;
      if (dark < kDarkShare * seen) continue;
      start = s;
      shadow = seen;
    }
    return shadow * axial_.spacing_mm >= options_.min_shadow_mm ? start : samples_;
  }

  /// `judged` is memory that is used again.
  void mark(int beam, std::vector<int>& judged) {
    find_judged(beam, judged);
    const bool no_contact = is_in_air(beam) || is_constant(beam) || is_dark(beam, judged);
    const int shadow = no_contact ? samples_ : shadow_start(beam, judged);
    std::uint8_t* reasons = result_.reasons.data() + at(beam, 0);
    const float* brightness = us_.brightness.data() + at(beam, 0);
    const double saturated_grey =
        options_.saturated_grey.value_or(std::numeric_limits<double>::infinity());
    for (std::size_t s = 0; s < outside_.size(); ++s) {
      const int saturated = brightness[s] >= saturated_grey ? kSaturated : 0;
      reasons[s] = static_cast<std::uint8_t>(outside_[s] | saturated);
    }
    const auto mark_from = [&](int first, ExclusionReason reason) {
      for (int s = first; s < samples_; ++s) reasons[s] |= reason;
    };
    mark_from(wall_[static_cast<std::size_t>(beam)], kFarWall);
    mark_from(shadow, kShadow);
    if (no_contact) mark_from(0, kNoContact);
    for (int s = 0; s < samples_; ++s)
      if (!is_known(at(beam, s))) reasons[s] |= kUnknown;
  }

  const BeamUltrasound& us_;
  const ConditioningOptions& options_;
  ConditionedUltrasound& result_;
  AxialSampling axial_;
  int samples_;
  int beams_;
  const std::uint8_t* known_;  // null if all brightness is known
  LargeVector<float> soft_;    // brightness after averaging of speckle; 0 where it is not known
  std::vector<int> wall_;
  std::vector<std::uint8_t> air_;  // frames in air; empty if there are none
  // One entry per depth:
  DepthProfiles profiles_;             // of soft_; the usual grey value is the median
  std::vector<std::uint8_t> visible_;  // 0 where even the usual grey is dark, or outside_
  std::vector<std::uint8_t> outside_;  // kOutsideDepth, or 0
};

}  // namespace

void exclude(const BeamUltrasound& ultrasound, const ConditioningOptions& options,
             ConditionedUltrasound& result) {
  Exclusion(ultrasound, options, result).run();
}

}  // namespace usct
