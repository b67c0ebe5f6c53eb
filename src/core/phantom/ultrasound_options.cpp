#include "us_ct_registration/phantom/ultrasound_options.h"

#include "phantom/check.h"

namespace usct::phantom {

void UltrasoundOptions::validate(int lines) const {
  if (frequency_mhz) require_range("frequency_mhz", *frequency_mhz, 1.0, 20.0);
  require_range("pulse_cycles", pulse_cycles, 1.0, 10.0);
  require_range("aperture_mm", aperture_mm, 2.0, 60.0);
  require_range("f_number", f_number, 1.0, 10.0);
  if (transmit_focus_mm) require_range("transmit_focus_mm", *transmit_focus_mm, 5.0, 300.0);
  require_range("elevation_aperture_mm", elevation_aperture_mm, 2.0, 60.0);
  require_range("elevation_focus_mm", elevation_focus_mm, 5.0, 300.0);
  require_range("dynamic_range_db", dynamic_range_db, 20.0, 120.0);
  require_range("cortex_grey", cortex_grey, 1.0, 254.0);
  require_range("penetration_mm", penetration_mm, 10.0, 1000.0);
  require_range("tgc_error_db", tgc_error_db, 0.0, 20.0);
  require_range("lateral_gain_error_db", lateral_gain_error_db, 0.0, 20.0);
  require_range("frame_gain_error_db", frame_gain_error_db, 0.0, 20.0);
  require_range("edge_loss_db", edge_loss_db, 0.0, 40.0);
  require_range("clutter_db", clutter_db, -120.0, 0.0);
  require_range("near_field_db", near_field_db, -120.0, 40.0);
  require_range("specular", specular, 0.0, 10.0);
  require_range("reverberation", reverberation, 0.0, 10.0);
  const int half_the_lines = lines / 2;
  require_range("no_contact_lines", no_contact_lines, 0, half_the_lines);
  require_range("sound_speed_error", sound_speed_error, -0.1, 0.1);
  require_range("tissue_speeds", tissue_speeds, 0.0, 1.0);
  require_range("echo_texture_db", echo_texture_db, 0.0, 12.0);
  require_range("edge_shadows", edge_shadows, 0.0, 1.0);
}

}  // namespace usct::phantom
