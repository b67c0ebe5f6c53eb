#pragma once

#include <array>
#include <limits>
#include <string>
#include <utility>

namespace usct {

/// The samples that count: all; every other one along each line, across lines and across frames (a
/// face-centred lattice), which takes half the time and averages less noise; or every fourth one
/// along each line, staggered across lines and frames.
enum class SampleSubset { kAll, kHalf, kQuarter };

constexpr auto words_of(SampleSubset) {
  return std::array<std::pair<SampleSubset, const char*>, 3>{{{SampleSubset::kAll, "all"},
                                                              {SampleSubset::kHalf, "half"},
                                                              {SampleSubset::kQuarter, "quarter"}}};
}

/// Options for cutting ultrasound into patches. Metrics with one set of weights for all samples use
/// patches as well, since the patch decides which samples count.
struct PatchOptions {
  /// Edges, mm, along the beams, across lines and across frames, measured at the middle depth since
  /// beams diverge; across frames, if a tracked probe hardly moves the field there, at the place of
  /// the median motion. Infinite: one patch along that axis.
  double depth_mm = 4.0;
  double lateral_mm = 4.0;
  double elevation_mm = 4.0;
  /// A patch counts if at least this share of its samples is known; (0, 1].
  double least_share = 0.5;
  SampleSubset samples = SampleSubset::kAll;

  /// One patch that holds all samples.
  static PatchOptions whole() {
    const double infinite = std::numeric_limits<double>::infinity();
    return {infinite, infinite, infinite, 1e-6, SampleSubset::kAll};
  }
  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "patch options") const;

  friend bool operator==(const PatchOptions& a, const PatchOptions& b) {
    return a.depth_mm == b.depth_mm && a.lateral_mm == b.lateral_mm &&
           a.elevation_mm == b.elevation_mm && a.least_share == b.least_share &&
           a.samples == b.samples;
  }
};

template <typename Fields>
void describe(Fields& fields, PatchOptions& o) {
  fields("depth_mm", o.depth_mm);
  fields("lateral_mm", o.lateral_mm);
  fields("elevation_mm", o.elevation_mm);
  fields("least_share", o.least_share);
  fields("samples", o.samples);
}

}  // namespace usct
