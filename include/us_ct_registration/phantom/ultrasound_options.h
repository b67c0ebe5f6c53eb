#pragma once

#include <optional>

/// Options of the image formation of the phantom's scanner.
namespace usct::phantom {

struct UltrasoundOptions {
  /// Transmit frequency, MHz; [1, 20]. Unset: 5 for agar, 3.5 for a body.
  std::optional<double> frequency_mhz;
  /// Length of the pulse in periods; [1, 10].
  double pulse_cycles = 2.5;
  /// Largest aperture, mm, and ratio of depth to aperture above it; [2, 60], [1, 10].
  double aperture_mm = 16.0;
  double f_number = 2.5;
  /// Depth of the transmit focus, mm; [5, 300]. Unset: at the kidney.
  std::optional<double> transmit_focus_mm;
  /// Height of the array (out of plane), mm, and depth of its lens' focus, mm.
  double elevation_aperture_mm = 10.0;
  double elevation_focus_mm = 60.0;

  /// Range of levels that the 8 bits show, dB; [20, 120].
  double dynamic_range_db = 60.0;
  /// Grey value of renal cortex if gain and TGC were perfect; [1, 254].
  double cortex_grey = 95.0;
  /// Depth at which the electronic noise drowns soft tissue (0.5 dB/cm/MHz), mm; smaller is a
  /// weaker scanner; [10, 1000].
  double penetration_mm = 150.0;
  /// Whether gain rises with depth to compensate attenuation; without it the image darkens with
  /// depth.
  bool time_gain_compensation = true;
  /// Standard deviation of the operator's eight TGC sliders, dB; [0, 20].
  double tgc_error_db = 2.0;
  /// Standard deviation of smooth gain variations across the lines and over the frames, dB;
  /// [0, 20].
  double lateral_gain_error_db = 1.5;
  double frame_gain_error_db = 0.7;
  /// Loss at the outermost lines, where part of the aperture is missing, dB; [0, 40].
  double edge_loss_db = 7.0;
  /// Haze from side lobes and multiple scattering, relative to the tissue around, dB; [-120, 0].
  double clutter_db = -24.0;
  /// Ring-down of the array at its surface, relative to cortex, dB; [-120, 40].
  double near_field_db = 8.0;
  /// Factor on the amplitude of specular echoes; [0, 10].
  double specular = 1.0;
  /// Factor on the amplitude of reverberation below gas and behind strong interfaces; [0, 10].
  double reverberation = 1.0;
  /// Lines at one edge of the fan without contact to the skin; [0, lines / 2].
  int no_contact_lines = 0;
  /// The scanner assumes a speed of sound (1 + error) times the true one, so every echo is shown
  /// at (1 + error) times its depth; [-0.1, 0.1].
  double sound_speed_error = 0.0;
  /// Weight of the tissues' own speeds of sound (fat 1450, muscle 1580 m/s), so that layers shift
  /// the echoes from below them; 0: one speed everywhere; [0, 1].
  double tissue_speeds = 0.0;
  /// Standard deviation of smooth variations of the echogenicity within every tissue that the CT
  /// does not show, dB; [0, 12].
  double echo_texture_db = 0.0;
  /// Weight of the shadows below edges where the beam grazes a step of the speed of sound, as at
  /// the sides of a cyst; [0, 1], 0: none. The lines stay straight.
  double edge_shadows = 0.0;

  void validate(int lines) const;
};

}  // namespace usct::phantom
