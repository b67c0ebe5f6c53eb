#include "similarity/ultrasound_patches.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "parallel.h"
#include "require.h"
#include "similarity/sweep_motion.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Ultrasound of a smaller deviation (in units of that of all ultrasound) counts as constant.
constexpr double kLeastDeviation = 1e-4;

constexpr std::size_t kLanes = UltrasoundPatches::kLanes;

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

/// Step between the samples of a line that count.
int step_of(SampleSubset samples) {
  switch (samples) {
    case SampleSubset::kAll:
      return 1;
    case SampleSubset::kHalf:
      return 2;
    case SampleSubset::kQuarter:
      return 4;
  }
  return 1;
}

class Cutter {
 public:
  Cutter(const BeamUltrasound& ultrasound, const PatchOptions& options, PatchContents contents)
      : us_(ultrasound),
        with_beams_(contents == PatchContents::kWithBeams),
        size_(patch_size(ultrasound.beams, options)),
        step_(step_of(options.samples)),
        least_share_(options.least_share) {}

  UltrasoundPatches run() {
    choose();
    lay_out();
    allocate();
    const std::vector<Beam> motions = with_beams_ ? sweep_motions() : std::vector<Beam>{};
    constexpr std::size_t kAtOnce = 64;
    parallel_ranges(
        boxes_.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t patch = begin; patch < end; ++patch) fill(patch, motions);
        },
        kAtOnce);
    enclose();
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

  /// Calls visit(beam) for the beams of a box, an index and the sum of line and frame.
  template <typename Visit>
  void for_beams(const Box& box, const Visit& visit) const {
    for (int f = box.begin.z(); f < box.end.z(); ++f)
      for (int l = box.begin.y(); l < box.end.y(); ++l) visit(beam_index(f, l), l + f);
  }

  /// Calls visit(sample, offset) for the known samples of the subset that lie on one beam of a box.
  template <typename Visit>
  void for_known(const Box& box, std::size_t beam, int line_and_frame, const Visit& visit) const {
    const std::size_t start = beam * static_cast<std::size_t>(us_.beams.samples());
    const std::uint8_t* const known = us_.known.empty() ? nullptr : us_.known.data() + start;
    for (int s = first_sample(box, line_and_frame); s < box.end.x(); s += step_)
      if (known == nullptr || known[s] != 0) visit(s, start + static_cast<std::size_t>(s));
  }

  int first_sample(const Box& box, int line_and_frame) const {
    return box.begin.x() + (box.begin.x() + line_and_frame) % step_;
  }

  /// Chooses the boxes that count, with the statistics of their ultrasound.
  void choose() {
    const Vector3i all(us_.beams.samples(), us_.beams.lines, us_.beams.frames);
    const int layers = (all.z() + size_.z() - 1) / size_.z();
    std::vector<std::vector<Box>> chosen(static_cast<std::size_t>(layers));
    parallel_for(layers, [&](int layer) {
      const int f = layer * size_.z();
      std::vector<Box> column;
      for (int l = 0; l < all.y(); l += size_.y()) {
        column.clear();
        for (int s = 0; s < all.x(); s += size_.x()) {
          const Vector3i begin(s, l, f);
          column.push_back({begin, (begin + size_).cwiseMin(all), {}});
        }
        add_counting(column, chosen[static_cast<std::size_t>(layer)]);
      }
    });
    for (const std::vector<Box>& boxes : chosen)
      boxes_.insert(boxes_.end(), boxes.begin(), boxes.end());
    std::stable_sort(boxes_.begin(), boxes_.end(),
                     [](const Box& a, const Box& b) { return a.patch.count > b.patch.count; });
  }

  /// Finds the statistics of boxes that lie behind each other on the same beams, and adds those
  /// that count to `chosen`. Beam by beam, the sums of many boxes are added to at the same time;
  /// those of one box would wait for each other.
  void add_counting(std::vector<Box>& column, std::vector<Box>& chosen) const {
    std::vector<int> samples(column.size());  // of the subset, known or not
    for_beams(column.front(), [&](std::size_t beam, int line_and_frame) {
      for (std::size_t i = 0; i < column.size(); ++i) {
        UltrasoundPatches::Patch patch = column[i].patch;
        samples[i] +=
            (column[i].end.x() - first_sample(column[i], line_and_frame) + step_ - 1) / step_;
        for_known(column[i], beam, line_and_frame, [&](int sample, std::size_t offset) {
          patch.mean += us_.brightness[offset];
          patch.depth_mm += us_.beams.axial.depth_mm(sample);
          ++patch.count;
        });
        column[i].patch = patch;
      }
    });
    for (std::size_t i = 0; i < column.size(); ++i) {
      UltrasoundPatches::Patch& patch = column[i].patch;
      const auto count = static_cast<double>(patch.count);
      if (count < least_share_ * samples[i]) patch.count = 0;
      patch.mean /= count;
      patch.depth_mm /= count;
      const Vector3i middle = (column[i].begin + column[i].end) / 2;
      patch.centre_us_mm = us_.beams.point(middle.z(), middle.y(), middle.x());
    }
    for_beams(column.front(), [&](std::size_t beam, int line_and_frame) {
      for (Box& box : column) {
        const double mean = box.patch.mean;
        double square_sum = box.patch.square_sum;
        for_known(box, beam, line_and_frame, [&](int, std::size_t offset) {
          const double difference = us_.brightness[offset] - mean;
          square_sum += difference * difference;
        });
        box.patch.square_sum = square_sum;
      }
    });
    std::copy_if(column.begin(), column.end(), std::back_inserter(chosen), [](const Box& box) {
      return box.patch.count >= 2 &&
             box.patch.square_sum >
                 kLeastDeviation * kLeastDeviation * static_cast<double>(box.patch.count);
    });
  }

  /// Number of samples of a strand of a patch.
  static std::size_t length(const UltrasoundPatches::Patch& patch, std::size_t strand) {
    const std::size_t strands = patch.strands();
    return (strand + 1) * patch.count / strands - strand * patch.count / strands;
  }

  /// Arranges strands in blocks.
  void lay_out() {
    const auto next_block = [&] {
      lengths_.resize((lengths_.size() + kLanes - 1) / kLanes * kLanes);
    };
    for (Box& box : boxes_) {
      const bool single = box.patch.count <= UltrasoundPatches::kLongestStrand;
      if (!single) ++result_.first_single_patch;
      if (single && result_.first_single_patch == result_.patches.size()) {
        next_block();
        result_.first_single_block = lengths_.size() / kLanes;
      }
      box.patch.first_strand = lengths_.size();
      result_.count += box.patch.count;
      result_.patches.push_back(box.patch);
      const std::size_t strands = box.patch.strands();
      for (std::size_t i = 0; i < strands; ++i) lengths_.push_back(length(box.patch, i));
    }
    next_block();
    if (result_.first_single_patch == result_.patches.size())
      result_.first_single_block = lengths_.size() / kLanes;
    std::size_t begin = 0;
    for (auto lane = lengths_.begin(); lane != lengths_.end(); lane += kLanes) {
      const auto [least, most] = std::minmax_element(lane, lane + kLanes);
      result_.blocks.push_back({begin, *most, *least, {}});
      begin += *most * kLanes;
    }
    size_in_memory_ = begin;
    strand_boxes_.resize(lengths_.size());
  }

  /// Allocates the arrays, whose pages the threads touch first when they fill them.
  void allocate() {
    arrays_ = {&result_.x_mm, &result_.y_mm, &result_.z_mm, &result_.value};
    if (with_beams_) {
      arrays_.insert(arrays_.end(),
                     {&result_.direction_x, &result_.direction_y, &result_.direction_z,
                      &result_.sweep_x, &result_.sweep_y, &result_.sweep_z, &result_.depth_mm});
      result_.by_errors_mm.resize(result_.patches.size());
    }
    for (LargeVector<float>* values : arrays_) values->resize(size_in_memory_);
  }

  /// Writes padding behind the samples of a strand, as far as its block reaches.
  void pad(std::size_t strand) {
    const UltrasoundPatches::Block& block = result_.blocks[strand / kLanes];
    for (std::size_t row = lengths_[strand]; row < block.rows; ++row) {
      const std::size_t place = block.begin + row * kLanes + strand % kLanes;
      for (std::size_t i = 0; i < arrays_.size(); ++i)
        (*arrays_[i])[place] = i < 3 ? UltrasoundPatches::kNowhere : 0.0F;
    }
  }

  void fill(std::size_t p, const std::vector<Beam>& motions) {
    const UltrasoundPatches::Patch& patch = result_.patches[p];
    Eigen::Matrix<double, 3, 2> by_errors_mm = Eigen::Matrix<double, 3, 2>::Zero();  // sum
    std::size_t strand = patch.first_strand;
    std::size_t place = place_of(strand);
    std::size_t left = length(patch, 0);
    Eigen::AlignedBox3f box;
    for_beams(boxes_[p], [&](std::size_t beam, int line_and_frame) {
      for_known(boxes_[p], beam, line_and_frame, [&](int sample, std::size_t offset) {
        if (left == 0) {
          strand_boxes_[strand] = box;
          box.setEmpty();
          pad(strand);
          ++strand;
          place = place_of(strand);
          left = length(patch, strand - patch.first_strand);
        }
        const double depth_mm = us_.beams.axial.depth_mm(sample);
        box.extend(put_position(place, us_.beams.beams[beam], depth_mm));
        if (with_beams_)
          by_errors_mm += put_beam(place, us_.beams.beams[beam], motions[beam], depth_mm);
        result_.value[place] = static_cast<float>(us_.brightness[offset] - patch.mean);
        place += kLanes;
        --left;
      });
    });
    strand_boxes_[strand] = box;
    pad(strand);
    if (with_beams_) result_.by_errors_mm[p] = by_errors_mm / static_cast<double>(patch.count);
  }

  /// Finds the boxes of the blocks, and pads lanes that have no strand.
  void enclose() {
    for (std::size_t strand = 0; strand < strand_boxes_.size(); ++strand) {
      result_.blocks[strand / kLanes].box.extend(strand_boxes_[strand]);
      if (lengths_[strand] == 0) pad(strand);
    }
  }

  /// The place of the first sample of a strand.
  std::size_t place_of(std::size_t strand) const {
    return result_.blocks[strand / kLanes].begin + strand % kLanes;
  }

  static void set(const Vector3d& vector, std::size_t place, LargeVector<float>& x,
                  LargeVector<float>& y, LargeVector<float>& z) {
    x[place] = static_cast<float>(vector.x());
    y[place] = static_cast<float>(vector.y());
    z[place] = static_cast<float>(vector.z());
  }

  Eigen::Vector3f put_position(std::size_t place, const Beam& beam, double depth_mm) {
    const Vector3d position = beam.origin_mm + depth_mm * beam.direction;
    set(position, place, result_.x_mm, result_.y_mm, result_.z_mm);
    return position.cast<float>();
  }

  /// Returns how the sample moves per unit of each of the AcquisitionErrors, mm.
  Eigen::Matrix<double, 3, 2> put_beam(std::size_t place, const Beam& beam, const Beam& motion,
                                       double depth_mm) {
    Eigen::Matrix<double, 3, 2> by_errors_mm;
    by_errors_mm << depth_mm * beam.direction, motion.origin_mm + depth_mm * motion.direction;
    set(beam.direction, place, result_.direction_x, result_.direction_y, result_.direction_z);
    set(by_errors_mm.col(1), place, result_.sweep_x, result_.sweep_y, result_.sweep_z);
    result_.depth_mm[place] = static_cast<float>(depth_mm);
    return by_errors_mm;
  }

  const BeamUltrasound& us_;
  bool with_beams_;
  Vector3i size_;
  int step_;  // step between counting samples of a line
  double least_share_;
  std::vector<Box> boxes_;
  std::vector<std::size_t> lengths_;  // number of samples of each strand; 0: there is none
  std::vector<Eigen::AlignedBox3f> strand_boxes_;
  std::size_t size_in_memory_ = 0;
  UltrasoundPatches result_;
  std::vector<LargeVector<float>*> arrays_;  // those of the result, positions first
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
