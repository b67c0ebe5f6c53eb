#include "similarity/ultrasound_patches.h"

#include <algorithm>
#include <utility>

#include "parallel.h"
#include "require.h"
#include "similarity/patch_boxes.h"
#include "ultrasound/sweep_motion.h"

namespace usct {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kLanes = UltrasoundPatches::kLanes;

class Cutter {
 public:
  Cutter(const BeamUltrasound& ultrasound, const PatchOptions& options, PatchContents contents)
      : us_(ultrasound),
        with_beams_(contents == PatchContents::kWithBeams),
        counting_(ultrasound, options.samples),
        boxes_(choose_boxes(ultrasound, options)) {}

  UltrasoundPatches run() {
    lay_out();
    allocate();
    const std::vector<BeamMotion> motions =
        with_beams_ ? sweep_motions() : std::vector<BeamMotion>{};
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
  /// How a beam moves per unit of AcquisitionErrors::sweep, mm, and the side of the sweep it is on.
  struct BeamMotion {
    Beam by_sweep;
    double side;
  };

  /// The motions of all beams.
  std::vector<BeamMotion> sweep_motions() const {
    const SweepMotion motion(us_.beams);
    std::vector<BeamMotion> motions;
    motions.reserve(us_.beams.beams.size());
    for (int f = 0; f < us_.beams.frames; ++f)
      for (int l = 0; l < us_.beams.lines; ++l)
        motions.push_back({motion.per_error(f, l), motion.side(f)});
    return motions;
  }

  /// Arranges strands in blocks.
  void lay_out() {
    const auto next_block = [&] {
      lengths_.resize((lengths_.size() + kLanes - 1) / kLanes * kLanes);
    };
    for (PatchBox& box : boxes_) {
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
      for (std::size_t i = 0; i < strands; ++i) lengths_.push_back(box.patch.rows_of(i));
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
      arrays_.insert(arrays_.end(), {&result_.direction_x, &result_.direction_y,
                                     &result_.direction_z, &result_.sweep_x, &result_.sweep_y,
                                     &result_.sweep_z, &result_.sweep_side, &result_.depth_mm});
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

  void fill(std::size_t p, const std::vector<BeamMotion>& motions) {
    const UltrasoundPatches::Patch& patch = result_.patches[p];
    Eigen::Matrix3d by_errors_mm = Eigen::Matrix3d::Zero();  // sum
    std::size_t strand = patch.first_strand;
    std::size_t place = place_of(strand);
    std::size_t left = patch.rows_of(0);
    std::vector<int> samples = counting_.none();
    counting_.for_beams(boxes_[p], [&](std::size_t beam, int line_and_frame) {
      const std::size_t count = counting_.find(boxes_[p], beam, line_and_frame, samples);
      for (std::size_t i = 0; i < count;) {
        if (left == 0) {
          pad(strand);
          ++strand;
          place = place_of(strand);
          left = patch.rows_of(strand - patch.first_strand);
        }
        const OfBeam part{beam, samples.data() + i, std::min(left, count - i)};
        strand_boxes_[strand].extend(put_positions(place, part, patch.mean));
        if (with_beams_) by_errors_mm += put_beam(place, part, motions[beam]);
        place += part.count * kLanes;
        left -= part.count;
        i += part.count;
      }
    });
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

  /// Samples of one beam that follow each other in a strand, one at least.
  struct OfBeam {
    std::size_t beam;
    const int* samples;
    std::size_t count;
  };

  /// Returns the box that holds them.
  Eigen::AlignedBox3f put_positions(std::size_t place, const OfBeam& part, double mean) {
    const Beam& beam = us_.beams.beams[part.beam];
    const AxialSampling axial = us_.beams.axial;
    const float* brightness = counting_.brightness(part.beam);
    float* const x = result_.x_mm.data() + place;
    float* const y = result_.y_mm.data() + place;
    float* const z = result_.z_mm.data() + place;
    float* const value = result_.value.data() + place;
    for (std::size_t i = 0; i < part.count; ++i) {
      const Vector3d at = beam.origin_mm + axial.depth_mm(part.samples[i]) * beam.direction;
      x[i * kLanes] = static_cast<float>(at.x());
      y[i * kLanes] = static_cast<float>(at.y());
      z[i * kLanes] = static_cast<float>(at.z());
      value[i * kLanes] = static_cast<float>(brightness[part.samples[i]] - mean);
    }
    // They lie on a line, so that the first and the last one enclose all.
    const std::size_t last = (part.count - 1) * kLanes;
    Eigen::AlignedBox3f box(Eigen::Vector3f(*x, *y, *z));
    return box.extend(Eigen::Vector3f(x[last], y[last], z[last]));
  }

  static void set(const Vector3d& vector, std::size_t place, LargeVector<float>& x,
                  LargeVector<float>& y, LargeVector<float>& z) {
    x[place] = static_cast<float>(vector.x());
    y[place] = static_cast<float>(vector.y());
    z[place] = static_cast<float>(vector.z());
  }

  /// Returns the sum over the samples of how they move per unit of each of the AcquisitionErrors,
  /// mm.
  Eigen::Matrix3d put_beam(std::size_t place, const OfBeam& part, const BeamMotion& of_beam) {
    const Beam& beam = us_.beams.beams[part.beam];
    const Beam& motion = of_beam.by_sweep;
    double sum_of_depths_mm = 0.0;
    for (std::size_t i = 0; i < part.count; ++i, place += kLanes) {
      const double depth_mm = us_.beams.axial.depth_mm(part.samples[i]);
      sum_of_depths_mm += depth_mm;
      set(beam.direction, place, result_.direction_x, result_.direction_y, result_.direction_z);
      set(motion.origin_mm + depth_mm * motion.direction, place, result_.sweep_x, result_.sweep_y,
          result_.sweep_z);
      result_.sweep_side[place] = static_cast<float>(of_beam.side);
      result_.depth_mm[place] = static_cast<float>(depth_mm);
    }
    const Vector3d by_sweep_mm =
        static_cast<double>(part.count) * motion.origin_mm + sum_of_depths_mm * motion.direction;
    Eigen::Matrix3d by_errors_mm;
    by_errors_mm << sum_of_depths_mm * beam.direction, by_sweep_mm, of_beam.side * by_sweep_mm;
    return by_errors_mm;
  }

  const BeamUltrasound& us_;
  bool with_beams_;
  CountingSamples counting_;
  std::vector<PatchBox> boxes_;
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
