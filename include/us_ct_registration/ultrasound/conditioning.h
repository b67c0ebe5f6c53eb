#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

/// Prepares ultrasound for a metric: decides which samples count, and removes the effect of the
/// scanner's gain from them. HuWindow (volume/hu_window.h) prepares the CT.
namespace usct {

/// Why a sample does not count; the reasons are bits, of which a sample may have several.
enum ExclusionReason : std::uint8_t {
  kUnknown = 1,       // beside the fan
  kOutsideDepth = 2,  // not within the depths of interest: near field, skin line, standoff
  kFarWall = 4,       // at or beyond the bright echo of a wall behind the anatomy
  kNoContact = 8,     // its line is dark or constant
  kSaturated = 16,    // at the top of the grey scale
  kShadow = 32,       // dark from here to the end of the line
  kConstant = 64,     // no sample that would count differs from another
};
/// The name of a reason, for people.
std::string to_string(ExclusionReason reason);

/// The depths at which samples count.
struct DepthOptions {
  /// Samples count between these depths (mm along the line, from the array). If unset, the limits
  /// are found from the ultrasound if `automatic` is on, and are the first and last sample if it is
  /// off.
  std::optional<double> min_mm;
  std::optional<double> max_mm;
  /// Whether limits that are unset are found from the ultrasound (see `condition`).
  bool automatic = true;
  /// The near field is at least this long, mm.
  double near_field_mm = 10.0;
  /// The end of the near field is searched for down to this depth, mm, and at most down to a third
  /// of the line.
  double near_field_limit_mm = 30.0;
  /// A far wall is accepted if at least this share of the beams meets it; above 1 none is searched
  /// for.
  double far_wall_share = 0.6;
  /// Samples up to this distance in front of the wall's echo count as part of it, mm.
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
  /// The square of this is added to the local variance, so that noise in empty regions is not
  /// amplified; in multiples of the standard deviation of all samples that count.
  double least_deviation = 0.1;
  DepthOptions depth;
  /// Samples of at least this grey value are saturated; above 255 no sample is.
  double saturated_grey = 255.0;
  /// A line has no contact if each quarter of it is darker than the first share of the usual grey
  /// value at its depth (the median over all beams); a sample is in shadow below the second share.
  /// Both are judged after speckle has been averaged.
  double no_contact_share = 0.45;
  double shadow_share = 0.45;
  /// Contact and shadow are judged only at depths where the usual grey value is at least this.
  double visible_grey = 20.0;
  /// Shadows shorter than this are not excluded, mm.
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
  /// The share of the beams that end at a far wall.
  double far_wall_share = 0.0;

  std::size_t counting() const;
};

/// Excludes samples and normalises the others. The result has the same bits for any number of
/// threads. Apart from the grey thresholds for saturation and visibility it does not depend on gain
/// and offset of the ultrasound.
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
/// Ultrasound of which no sample counts is no error: `reasons` tells why.
ConditionedUltrasound condition(const BeamUltrasound& ultrasound,
                                const ConditioningOptions& options, const Progress& progress = {});

}  // namespace usct
