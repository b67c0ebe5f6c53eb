#include "similarity/ultrasound_patches.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "parallel.h"
#include "require.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Ultrasound of a smaller deviation (in units of that of all ultrasound) counts as constant.
constexpr double kLeastDeviation = 1e-4;

constexpr std::size_t kLanes = UltrasoundPatches::kLanes;

/// Motion of the frames if the sweep is longer than recorded: the tangent of each beam's path,
/// times the distance of its frame from the middle of the sweep. A frame's position along the sweep
/// is the arc length of the path of the field's centre, smoothed since tracked poses jitter.
class SweepMotion {
 public:
  explicit SweepMotion(const BeamGrid& beams)
      : beams_(beams),
        window_(std::clamp(beams.frames / 10, 1, std::max(1, beams.frames / 2 - 1))) {
    path_mm_.push_back(0.0);
    for (int f = 1; f < beams.frames; ++f)
      path_mm_.push_back(path_mm_.back() + (smoothed_centre(f) - smoothed_centre(f - 1)).norm());
    for (int f = 0; f < beams.frames; ++f) tangents_.push_back(tangent(f));
  }

  /// Motion of a beam's origin and direction per unit of error, mm.
  Beam operator()(int frame, int line) const {
    Beam motion{Vector3d::Zero(), Vector3d::Zero()};
    const double from_middle_mm = path_mm(frame) - 0.5 * path_mm_.back();
    for (const auto& [other, per_mm] : tangents_[static_cast<std::size_t>(frame)]) {
      const Beam& beam = beams_.beam(other, line);
      motion.origin_mm += from_middle_mm * per_mm * beam.origin_mm;
      motion.direction += from_middle_mm * per_mm * beam.direction;
    }
    return motion;
  }

 private:
  /// Weights, 1/mm, of the values at frames in their derivative by the path.
  using Tangent = std::vector<std::pair<int, double>>;

  double path_mm(int frame) const { return path_mm_[static_cast<std::size_t>(frame)]; }

  /// Mean over a window that shrinks towards the ends of the sweep and so stays centred on the
  /// frame.
  Vector3d smoothed_centre(int frame) const {
    const int half = std::min({window_, frame, beams_.frames - 1 - frame});
    Vector3d sum = Vector3d::Zero();
    for (int f = frame - half; f <= frame + half; ++f)
      sum += beams_.point(f, beams_.lines / 2, 0.5 * beams_.samples());
    return sum / (2 * half + 1);
  }

  /// Tangent of the parabola through three frames around this one, or nearest to it at the ends of
  /// the sweep; of a straight line if there are fewer frames. Empty if nothing moves.
  Tangent tangent(int frame) const {
    const int last = beams_.frames - 1;
    const int margin = std::min(window_, last / 2);
    const int middle = std::clamp(frame, margin, last - margin);
    const int a = std::max(0, middle - window_);
    const int c = std::min(last, middle + window_);
    const double at = path_mm(frame), at_a = path_mm(a), at_b = path_mm(middle), at_c = path_mm(c);
    if (!(at_c > at_a)) return {};
    if (!(at_b > at_a && at_c > at_b)) return {{a, -1.0 / (at_c - at_a)}, {c, 1.0 / (at_c - at_a)}};
    return {{a, (2.0 * at - at_b - at_c) / ((at_a - at_b) * (at_a - at_c))},
            {middle, (2.0 * at - at_a - at_c) / ((at_b - at_a) * (at_b - at_c))},
            {c, (2.0 * at - at_a - at_b) / ((at_c - at_a) * (at_c - at_b))}};
  }

  const BeamGrid& beams_;
  int window_;  // number of frames on either side
  std::vector<double> path_mm_;
  std::vector<Tangent> tangents_;
};

/// Samples, lines and frames along each edge of a patch.
Vector3i patch_size(const BeamGrid& beams, const PatchOptions& options) {
  const double middle = 0.5 * (beams.samples() - 1);
  const auto steps = [](double edge_mm, double step_mm, int available) {
    if (!(step_mm > 0.0)) return available;
    return static_cast<int>(std::clamp(std::round(edge_mm / step_mm), 1.0, double(available)));
  };
  const auto distance = [&](int f_a, int l_a, int f_b, int l_b) {
    return (beams.point(f_a, l_a, middle) - beams.point(f_b, l_b, middle)).norm();
  };
  const int f = beams.frames / 2;
  const int l = beams.lines / 2;
  double line_mm = 0.0;
  for (int i = 1; i < beams.lines; ++i) line_mm += distance(f, i - 1, f, i) / (beams.lines - 1);
  double frame_mm = 0.0;
  for (int i = 1; i < beams.frames; ++i) frame_mm += distance(i - 1, l, i, l) / (beams.frames - 1);
  return {steps(options.depth_mm, beams.axial.spacing_mm, beams.samples()),
          steps(options.lateral_mm, line_mm, beams.lines),
          steps(options.elevation_mm, frame_mm, beams.frames)};
}

class Cutter {
 public:
  Cutter(const BeamUltrasound& ultrasound, const PatchOptions& options, PatchContents contents)
      : us_(ultrasound),
        with_beams_(contents == PatchContents::kWithBeams),
        size_(patch_size(ultrasound.beams, options)),
        step_(options.samples == SampleSubset::kHalf ? 2 : 1),
        least_share_(options.least_share) {}

  UltrasoundPatches run() {
    choose();
    lay_out();
    allocate();
    const std::vector<Beam> motions = with_beams_ ? sweep_motions() : std::vector<Beam>{};
    constexpr std::size_t kAtOnce = 64;
    const auto each_of = [](std::size_t count, const auto& work) {
      parallel_ranges(
          count,
          [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) work(i);
          },
          kAtOnce);
    };
    each_of(boxes_.size(), [&](std::size_t patch) { fill(patch, motions); });
    each_of(result_.blocks.size(), [&](std::size_t block) { enclose(result_.blocks[block]); });
    return std::move(result_);
  }

 private:
  struct Box {
    Vector3i begin, end;  // samples, lines, frames
    UltrasoundPatches::Patch patch;
  };

  std::size_t beam_index(int frame, int line) const {
    return static_cast<std::size_t>(frame) * static_cast<std::size_t>(us_.beams.lines) +
           static_cast<std::size_t>(line);
  }

  /// The motions of all beams.
  std::vector<Beam> sweep_motions() const {
    const SweepMotion motion(us_.beams);
    std::vector<Beam> motions;
    motions.reserve(us_.beams.beams.size());
    for (int f = 0; f < us_.beams.frames; ++f)
      for (int l = 0; l < us_.beams.lines; ++l) motions.push_back(motion(f, l));
    return motions;
  }

  /// Calls visit(beam, sample, offset) for the subset of samples that counts.
  template <typename Visit>
  void for_subset(const Box& box, const Visit& visit) const {
    for (int f = box.begin.z(); f < box.end.z(); ++f)
      for (int l = box.begin.y(); l < box.end.y(); ++l) {
        const std::size_t beam = beam_index(f, l);
        const std::size_t start = beam * static_cast<std::size_t>(us_.beams.samples());
        const int skipped = (box.begin.x() + l + f) % step_;
        for (int s = box.begin.x() + skipped; s < box.end.x(); s += step_)
          visit(beam, s, start + static_cast<std::size_t>(s));
      }
  }

  /// Calls visit for the known samples of the subset.
  template <typename Visit>
  void for_known(const Box& box, const Visit& visit) const {
    for_subset(box, [&](std::size_t beam, int sample, std::size_t offset) {
      if (us_.known.empty() || us_.known[offset] != 0) visit(beam, sample, offset);
    });
  }

  /// Chooses the boxes that count, with the statistics of their ultrasound.
  void choose() {
    const Vector3i all(us_.beams.samples(), us_.beams.lines, us_.beams.frames);
    const int layers = (all.z() + size_.z() - 1) / size_.z();
    std::vector<std::vector<Box>> chosen(static_cast<std::size_t>(layers));
    parallel_for(layers, [&](int layer) {
      const int f = layer * size_.z();
      for (int l = 0; l < all.y(); l += size_.y())
        for (int s = 0; s < all.x(); s += size_.x()) {
          const Vector3i begin(s, l, f);
          Box box{begin, (begin + size_).cwiseMin(all), {}};
          if (counts(box)) chosen[static_cast<std::size_t>(layer)].push_back(box);
        }
    });
    for (const std::vector<Box>& boxes : chosen)
      boxes_.insert(boxes_.end(), boxes.begin(), boxes.end());
    std::stable_sort(boxes_.begin(), boxes_.end(),
                     [](const Box& a, const Box& b) { return a.patch.count > b.patch.count; });
  }

  bool counts(Box& box) const {
    UltrasoundPatches::Patch& patch = box.patch;
    double all = 0.0;
    for_subset(box, [&](std::size_t, int, std::size_t) { all += 1.0; });
    for_known(box, [&](std::size_t, int sample, std::size_t offset) {
      patch.mean += us_.brightness[offset];
      patch.depth_mm += us_.beams.axial.depth_mm(sample);
      ++patch.count;
    });
    const Vector3i middle = (box.begin + box.end) / 2;
    patch.centre_us_mm = us_.beams.point(middle.z(), middle.y(), middle.x());
    const auto count = static_cast<double>(patch.count);
    if (patch.count < 2 || count < least_share_ * all) return false;
    patch.mean /= count;
    patch.depth_mm /= count;
    for_known(box, [&](std::size_t, int, std::size_t offset) {
      const double difference = us_.brightness[offset] - patch.mean;
      patch.square_sum += difference * difference;
    });
    return patch.square_sum > kLeastDeviation * kLeastDeviation * count;
  }

  /// Arranges strands in blocks.
  void lay_out() {
    std::vector<std::size_t> lengths;  // number of samples of each strand
    const auto next_block = [&] {
      lengths.resize((lengths.size() + kLanes - 1) / kLanes * kLanes);
    };
    for (Box& box : boxes_) {
      const bool single = box.patch.count <= UltrasoundPatches::kLongestStrand;
      if (!single) ++result_.first_single_patch;
      if (single && result_.first_single_patch == result_.patches.size()) {
        next_block();
        result_.first_single_block = lengths.size() / kLanes;
      }
      box.patch.first_strand = lengths.size();
      result_.count += box.patch.count;
      result_.patches.push_back(box.patch);
      const std::size_t strands = box.patch.strands();
      for (std::size_t i = 0; i < strands; ++i)
        lengths.push_back((i + 1) * box.patch.count / strands - i * box.patch.count / strands);
    }
    next_block();
    if (result_.first_single_patch == result_.patches.size())
      result_.first_single_block = lengths.size() / kLanes;
    std::size_t begin = 0;
    for (auto lane = lengths.begin(); lane != lengths.end(); lane += kLanes) {
      const auto [least, most] = std::minmax_element(lane, lane + kLanes);
      result_.blocks.push_back({begin, *most, *least, {}});
      begin += *most * kLanes;
    }
    size_in_memory_ = begin;
  }

  /// Allocates the arrays, filled with padding, which remains behind the shorter strands of a
  /// block.
  void allocate() {
    std::vector<std::pair<LargeVector<float>*, float>> all{
        {&result_.x_mm, UltrasoundPatches::kNowhere},
        {&result_.y_mm, UltrasoundPatches::kNowhere},
        {&result_.z_mm, UltrasoundPatches::kNowhere},
        {&result_.value, 0.0F}};
    if (with_beams_)
      for (auto* values : {&result_.direction_x, &result_.direction_y, &result_.direction_z,
                           &result_.sweep_x, &result_.sweep_y, &result_.sweep_z, &result_.depth_mm})
        all.emplace_back(values, 0.0F);
    for (const auto& [values, padding] : all) values->resize(size_in_memory_);
    parallel_ranges(size_in_memory_, [&](std::size_t begin, std::size_t end) {
      for (const auto& [values, padding] : all)
        std::fill(values->begin() + static_cast<std::ptrdiff_t>(begin),
                  values->begin() + static_cast<std::ptrdiff_t>(end), padding);
    });
  }

  void fill(std::size_t p, const std::vector<Beam>& motions) {
    const UltrasoundPatches::Patch& patch = result_.patches[p];
    const std::size_t strands = patch.strands();
    std::size_t strand = 0;
    std::size_t first = 0;  // first sample of the strand in its patch
    std::size_t next = patch.count / strands;
    std::size_t i = 0;
    for_known(boxes_[p], [&](std::size_t beam, int sample, std::size_t offset) {
      if (i == next) {
        ++strand;
        first = next;
        next = (strand + 1) * patch.count / strands;
      }
      const std::size_t lane = patch.first_strand + strand;
      const std::size_t place =
          result_.blocks[lane / kLanes].begin + (i - first) * kLanes + lane % kLanes;
      const double depth_mm = us_.beams.axial.depth_mm(sample);
      put_position(place, us_.beams.beams[beam], depth_mm);
      if (with_beams_) put_beam(place, us_.beams.beams[beam], motions[beam], depth_mm);
      result_.value[place] = static_cast<float>(us_.brightness[offset] - patch.mean);
      ++i;
    });
  }

  void enclose(UltrasoundPatches::Block& block) const {
    for (std::size_t s = block.begin; s < block.begin + block.rows * kLanes; ++s)
      if (result_.x_mm[s] != UltrasoundPatches::kNowhere)
        block.box.extend(Eigen::Vector3f(result_.x_mm[s], result_.y_mm[s], result_.z_mm[s]));
  }

  static void set(const Vector3d& vector, std::size_t place, LargeVector<float>& x,
                  LargeVector<float>& y, LargeVector<float>& z) {
    x[place] = static_cast<float>(vector.x());
    y[place] = static_cast<float>(vector.y());
    z[place] = static_cast<float>(vector.z());
  }

  void put_position(std::size_t place, const Beam& beam, double depth_mm) {
    set(beam.origin_mm + depth_mm * beam.direction, place, result_.x_mm, result_.y_mm,
        result_.z_mm);
  }

  void put_beam(std::size_t place, const Beam& beam, const Beam& motion, double depth_mm) {
    set(beam.direction, place, result_.direction_x, result_.direction_y, result_.direction_z);
    set(motion.origin_mm + depth_mm * motion.direction, place, result_.sweep_x, result_.sweep_y,
        result_.sweep_z);
    result_.depth_mm[place] = static_cast<float>(depth_mm);
  }

  const BeamUltrasound& us_;
  bool with_beams_;
  Vector3i size_;
  int step_;  // step between counting samples of a line
  double least_share_;
  std::vector<Box> boxes_;
  std::size_t size_in_memory_ = 0;
  UltrasoundPatches result_;
};

}  // namespace

void PatchOptions::validate(const std::string& source) const {
  require(depth_mm > 0.0, source, "depth_mm", depth_mm, "> 0");
  require(lateral_mm > 0.0, source, "lateral_mm", lateral_mm, "> 0");
  require(elevation_mm > 0.0, source, "elevation_mm", elevation_mm, "> 0");
  require(least_share > 0.0 && least_share <= 1.0, source, "least_share", least_share,
          "within (0, 1]");
}

UltrasoundPatches cut_into_patches(const BeamUltrasound& ultrasound, const PatchOptions& options,
                                   PatchContents contents) {
  ultrasound.validate();
  options.validate();
  return Cutter(ultrasound, options, contents).run();
}

}  // namespace usct
