#pragma once

namespace usct {

/// Errors of an acquisition that a registration may estimate along with the pose. All are
/// fractions, 0 where the recorded geometry is right.
struct AcquisitionErrors {
  /// Echoes lie at (1 + depth) times the recorded depth, as with a wrong speed of sound.
  double depth = 0.0;
  /// Frames lie (1 + sweep) times as far from the middle frame as recorded, by an error of the
  /// motor's angle or of the tracked path.
  double sweep = 0.0;
  /// It is added to `sweep` for the frames after the middle one, and taken from it for those
  /// before: a motor that is slower on one side than on the other.
  double unevenness = 0.0;

  bool any() const { return depth != 0.0 || sweep != 0.0 || unevenness != 0.0; }
};

}  // namespace usct
