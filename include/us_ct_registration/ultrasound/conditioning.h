#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

/// Prepares ultrasound for a metric: says which samples count, and takes out what the scanner's
/// gain does to the others. The CT's part is HuWindow (volume/hu_window.h).
namespace usct {

/// Why a sample does not count; bits.
enum ExclusionReason : std::uint8_t {
  kUnknown = 1,       // beside the fan
  kOutsideDepth = 2,  // not within the depths of interest: near field, skin line, standoff
  kFarWall = 4,       // at or beyond the bright echo of whatever lies behind
  kNoContact = 8,     // its line is dark or constant
  kSaturated = 16,    // at the top of the grey scale
  kShadow = 32,       // dark from here to the end of the line
  kConstant = 64,     // what would count does not vary
};
/// One bit as text.
std::string to_string(ExclusionReason reason);

/// Which depths count.
struct DepthOptions {
  /// Depths (mm along the line, from the array) between which samples count; unset: found, or the
  /// first and last sample where `automatic` is off.
  std::optional<double> min_mm;
  std::optional<double> max_mm;
  /// Find what is not given: see `condition`.
  bool automatic = true;
  /// The near field is at least this long, mm.
  double near_field_mm = 10.0;
  /// ... and searched for to this depth, mm, and no further than a third of the line.
  double near_field_limit_mm = 30.0;
  /// Share of the beams that must meet a far wall for it to be believed, (0, 1]; unset: none is
  /// looked for.
  std::optional<double> far_wall_share = 0.6;
  /// Samples this far in front of the wall's echo go with it, mm.
  double far_wall_margin_mm = 3.0;
};

enum class Normalisation {
  kNone,     // smoothed grey values
  kFlatten,  // minus the local mean
  kZScore,   // minus the local mean, over the local standard deviation
};

struct ConditioningOptions {
  Normalisation normalisation = Normalisation::kZScore;
  /// Standard deviation of the Gaussian that smooths speckle first, mm; 0: none.
  double smoothing_mm = 1.0;
  /// Standard deviation of the Gaussian window of local mean and standard deviation, mm.
  double window_mm = 8.0;
  /// Added (squared) to the local variance, as a share of the standard deviation of all samples
  /// that count: keeps noise in empty regions from being blown up.
  double least_deviation = 0.1;
  DepthOptions depth;
  /// Grey value from which a sample is saturated, and does not count, > 0; unset: none is.
  std::optional<double> saturated_grey = 255.0;
  /// A line without contact is darker than this share of what is usual at its depth (the median
  /// over all beams), in each quarter of it; a shadow at each sample. Speckle is averaged first.
  double no_contact_share = 0.45;
  double shadow_share = 0.45;
  /// ... judged only at depths where that usual grey value is at least this.
  double visible_grey = 20.0;
  /// Shorter shadows stay, mm.
  double min_shadow_mm = 10.0;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "conditioning options") const;
};

struct ConditionedUltrasound {
  int lines = 0;
  int frames = 0;
  /// Grey values (kNone), or multiples of the standard deviation of all samples that count
  /// (kFlatten), or of the local one (kZScore). 0 where a sample does not count.
  std::vector<float> samples;
  /// ExclusionReason; 0 where a sample counts.
  std::vector<std::uint8_t> reasons;
  /// The depths that count (far wall apart), mm.
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;
  /// Share of the beams cut at a far wall.
  double far_wall_share = 0.0;

  std::size_t counting() const;
};

/// Masks and normalises. The same bits for any number of threads; does not depend on gain and
/// offset of the ultrasound, as far as the grey thresholds for saturation and visibility allow.
///
/// Depths, if automatic. *Near field*: the profile of mean brightness over depth is compared with
/// its median over the middle half of the line; the near field ends behind the last depth (within
/// near_field_limit_mm) where the profile is out of that by more than 3 robust standard deviations
/// and 20 %. *Far wall*: per beam, in its deeper half, the first depth where brightness exceeds 1.5
/// times the upper decile of the first two thirds of all beams (at most grey 180); then the median
/// of that over neighbouring beams, so that single echoes do not count.
///
/// Windows are Gaussians in millimetres: along the samples, across lines by the distance of
/// neighbouring lines at that depth (in the middle frame), and across frames likewise (on the
/// middle line). Only samples that count enter.
///
/// Throws InputError if the ultrasound or an option is invalid, or the depth range holds no sample.
/// Ultrasound of which nothing counts is no error: `reasons` says why.
ConditionedUltrasound condition(const BeamUltrasound& ultrasound,
                                const ConditioningOptions& options, const Progress& progress = {});

}  // namespace usct
