#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

/// Prepares ultrasound for a similarity: excludes samples that carry no information about the
/// anatomy, and removes the effect of the scanner's gain from the others. HuWindow
/// (volume/hu_window.h) prepares the CT.
namespace usct {

/// Reasons why a sample is excluded; bits.
enum ExclusionReason : std::uint8_t {
  kUnknown = 1,       // its brightness is not known: it lies beside the fan
  kOutsideDepth = 2,  // not within the depths of interest: near field, skin line, standoff
  kFarWall = 4,       // at or beyond the bright echo of a wall behind the organ
  kNoContact = 8,     // its line is dark or constant
  kSaturated = 16,    // at the top of the grey scale
  kShadow = 32,       // dark from here to the end of the line
  kConstant = 64,     // the samples that would count do not vary
};
/// The name of one reason.
std::string to_string(ExclusionReason reason);

/// Depth range outside of which samples are excluded.
struct DepthOptions {
  /// Least and greatest depth of samples that count, mm along the line from the array. Unset: found
  /// automatically, or those of the first and last sample if `automatic` is off.
  std::optional<double> min_mm;
  std::optional<double> max_mm;
  /// Whether unset depths and the far wall are found from the brightness; see `condition`.
  bool automatic = true;
  /// Least length of the near field, mm.
  double near_field_mm = 10.0;
  /// Depth to which the end of the near field is searched, mm; never more than a third of the line.
  double near_field_limit_mm = 30.0;
  /// Share of the beams that must meet a far wall for it to be accepted, (0, 1]; unset: no wall is
  /// searched.
  std::optional<double> far_wall_share = 0.6;
  /// Samples in front of the wall by up to this are excluded with it, mm.
  double far_wall_margin_mm = 3.0;
};

enum class Normalisation {
  kNone,     // no normalisation: smoothed grey values
  kFlatten,  // minus the local mean
  kZScore,   // minus the local mean, over the local standard deviation
};

struct ConditioningOptions {
  Normalisation normalisation = Normalisation::kZScore;
  /// Standard deviation of the Gaussian that smooths speckle first, mm; 0: no smoothing.
  double smoothing_mm = 1.0;
  /// Standard deviation of the Gaussian window for the local mean and standard deviation, mm.
  double window_mm = 8.0;
  /// The square of this is added to the local variance, in units of the variance of all samples
  /// that count, so that noise in empty regions is not amplified.
  double least_deviation = 0.1;
  DepthOptions depth;
  /// Samples with at least this grey value are saturated and do not count, > 0; unset: none are.
  std::optional<double> saturated_grey = 255.0;
  /// A line has no contact if in each quarter of its depth it is darker than `no_contact_share` of
  /// the usual grey value, which is the median over all beams at that depth. A sample is dark, as
  /// in a shadow, if it is below `shadow_share` of the usual value. Speckle is averaged first.
  double no_contact_share = 0.45;
  double shadow_share = 0.45;
  /// Contact and shadows are judged only at depths where the usual grey value is at least this.
  double visible_grey = 20.0;
  /// Shadows shorter than this are not excluded, mm.
  double min_shadow_mm = 10.0;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "conditioning options") const;
};

struct ConditionedUltrasound {
  int lines = 0;
  int frames = 0;
  /// Grey values (kNone), multiples of the standard deviation of all samples that count (kFlatten),
  /// or multiples of the local standard deviation (kZScore). 0 where a sample is excluded.
  std::vector<float> samples;
  /// Bits of ExclusionReason; 0 where a sample counts.
  std::vector<std::uint8_t> reasons;
  /// Depth range of the samples that count, mm; the far wall is not part of it.
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;
  /// Share of the beams that end at a far wall.
  double far_wall_share = 0.0;

  std::size_t counting() const;
};

/// Excludes samples and normalises the rest. The result has the same bits for any number of
/// threads. It does not depend on gain and offset of the ultrasound, except through the absolute
/// grey thresholds for saturation and visibility.
///
/// Automatic depths. *Near field*: the profile of mean brightness over depth is compared with its
/// median over the middle half of the line. The near field ends behind the last depth (within
/// near_field_limit_mm) at which the profile differs from that median by more than 3 robust
/// standard deviations and by more than 20 %. *Far wall*: for each beam, the first depth in its
/// deeper half at which it is brighter than all beams are in their nearer half, behind the near
/// field, whatever the brightness and contrast of the display. The median of this depth over
/// neighbouring beams is taken, so that single echoes do not count.
///
/// Windows are Gaussians in millimetres: along the samples, across lines, and across frames. The
/// distance of neighbouring lines is taken at each depth in the middle frame, that of neighbouring
/// frames on the middle line or, if a tracked probe hardly moves the field there, on that of the
/// median motion (as in decimation.h). Only samples that count enter.
///
/// Throws InputError if the ultrasound or an option is invalid, or the depth range holds no sample.
/// It is not an error if no sample counts; `reasons` then gives the reasons.
ConditionedUltrasound condition(const BeamUltrasound& ultrasound,
                                const ConditioningOptions& options, const Progress& progress = {});

}  // namespace usct
