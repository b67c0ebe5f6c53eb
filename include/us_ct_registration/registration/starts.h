#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct {

/// The region of motions away from the initial pose over which starts are spread.
enum class StartRegion {
  /// Each component of the rotation vector and of the translation, along the axes of the US frame,
  /// within its bound.
  kBox,
  /// The angle of the rotation and the length of the translation within their bounds; rotations
  /// uniform in the sense of the rotation group, so that with 180 degrees all orientations are
  /// covered evenly.
  kBall,
};

constexpr auto words_of(StartRegion) {
  return std::array<std::pair<StartRegion, const char*>, 2>{
      {{StartRegion::kBox, "box"}, {StartRegion::kBall, "ball"}}};
}

struct StartOptions {
  StartRegion region = StartRegion::kBox;
  /// Number of starts, including the initial pose; 1 to a million.
  int count = 512;
  /// Half the width of the box (at most 103 degrees, so that no rotation exceeds 180), or the
  /// radius of the ball (at most 180 degrees); >= 0.
  double rotation_rad = 25.0 * kDegree;
  /// Half the width of the box, or the radius of the ball; 0 to 1000.
  double translation_mm = 25.0;

  /// Throws InputError, naming `source`, unless all fields satisfy the constraints above.
  void validate(const std::string& source) const;
};

/// `options.count` starts that are spread evenly without random numbers, from number `first` of
/// their sequence on: the same options give the same starts. Number 0 is the initial pose, 0. Every
/// prefix of the sequence is spread evenly as well.
///
/// The sequence is Sobol's (Sobol 1967, direction numbers of Joe and Kuo 2008); counts that are
/// powers of two are the most even.
std::vector<PoseVector> spread_starts(const PoseParameters& pose, const StartOptions& options,
                                      std::size_t first = 0);

}  // namespace usct
