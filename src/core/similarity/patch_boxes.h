#pragma once

#include <vector>

#include "similarity/ultrasound_patches.h"

namespace usct {

/// A box of the ultrasound that becomes a patch, with its statistics.
struct PatchBox {
  /// Samples, lines and frames.
  Eigen::Vector3i begin, end;
  UltrasoundPatches::Patch patch;
};

/// The samples of ultrasound of which patches are made: the known ones of a subset. Neighbouring
/// lines and frames begin their subset with different samples.
class CountingSamples {
 public:
  /// The ultrasound must outlive the object.
  CountingSamples(const BeamUltrasound& ultrasound, SampleSubset subset);

  /// Calls visit(beam, line + frame) for the beams of a box.
  template <typename Visit>
  void for_beams(const PatchBox& box, const Visit& visit) const {
    for (int f = box.begin.z(); f < box.end.z(); ++f)
      for (int l = box.begin.y(); l < box.end.y(); ++l) visit(us_.beams.beam_number(f, l), l + f);
  }

  /// Memory for the samples of a box on one beam.
  std::vector<int> none() const { return std::vector<int>(us_.beams.samples()); }
  /// Writes those that count on one beam of a box to the front of `samples`, and returns how many.
  std::size_t find(const PatchBox& box, std::size_t beam, int line_and_frame,
                   std::vector<int>& samples) const {
    const std::uint8_t* known = us_.known.empty() ? nullptr : us_.known.data() + first_of(beam);
    int* const found = samples.data();
    std::size_t count = 0;
    for (int s = first_sample(box, line_and_frame); s < box.end.x(); s += step_) {
      found[count] = s;
      count += known == nullptr || known[s] != 0 ? 1 : 0;
    }
    return count;
  }
  /// The number of samples of the subset there, known or not.
  int in_subset(const PatchBox& box, int line_and_frame) const {
    return (box.end.x() - first_sample(box, line_and_frame) + step_ - 1) / step_;
  }

  /// The brightness of a beam, by sample.
  const float* brightness(std::size_t beam) const { return us_.brightness.data() + first_of(beam); }

 private:
  std::size_t first_of(std::size_t beam) const {
    return beam * static_cast<std::size_t>(us_.beams.samples());
  }
  int first_sample(const PatchBox& box, int line_and_frame) const {
    return box.begin.x() + ((box.begin.x() + line_and_frame) & (step_ - 1));
  }

  const BeamUltrasound& us_;
  int step_;  // between the subset's samples of a beam: a power of two
};

/// The boxes that become patches: those with enough samples whose ultrasound is not constant. Those
/// with more samples come first, those of equal size in the order of the ultrasound.
std::vector<PatchBox> choose_boxes(const BeamUltrasound& ultrasound, const PatchOptions& options);

}  // namespace usct
