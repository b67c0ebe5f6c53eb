#pragma once

#include <array>
#include <string>
#include <utility>

namespace usct {

/// The channel that explains ultrasound together with the CT value.
enum class GradientChannel {
  kMagnitude,  // |grad mu|
  kAlongBeam,  // |d . grad mu|, which reflects a beam back to the array (eq 4.3)
};

constexpr auto words_of(GradientChannel) {
  return std::array<std::pair<GradientChannel, const char*>, 2>{
      {{GradientChannel::kMagnitude, "magnitude"}, {GradientChannel::kAlongBeam, "along_beam"}}};
}

/// Options of LC2 (Wein 2008), the linear combination of CT value and gradient that explains the
/// ultrasound, found by least squares with ridge regularisation.
struct Lc2Options {
  GradientChannel channel = GradientChannel::kMagnitude;
  /// A patch whose CT values have this standard deviation, or less, explains little. Without a
  /// ridge, noise and faint structure explain as much as an edge. 0: no ridge.
  double ridge_intensity_hu = 20.0;
  double ridge_gradient_hu_per_mm = 40.0;
  /// Whether the gradient can only brighten the ultrasound, as interfaces do: its weight is >= 0.
  bool positive_gradient = true;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source) const;
};

template <typename Fields>
void describe(Fields& fields, Lc2Options& o) {
  fields("channel", o.channel);
  fields("ridge_intensity_hu", o.ridge_intensity_hu);
  fields("ridge_gradient_hu_per_mm", o.ridge_gradient_hu_per_mm);
  fields("positive_gradient", o.positive_gradient);
}

}  // namespace usct
