#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/ultrasound_beams.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::tools {

/// Command-line options for the initial pose of a registration.
class InitialPose {
 public:
  void add_to(CLI::App& command);

  bool is_given() const {
    return !transform_.empty() || !landmarks_.empty() || !probe_direction_.empty();
  }
  /// The initial T_us_ct. Without any option the centre of the CT is placed at the centre of the
  /// ultrasound's field, for a probe that looks posterior with its lateral axis to the left.
  Eigen::Isometry3d T_us_ct(const CtVolume& ct, const BeamGrid& beams) const;

 private:
  std::string transform_;
  std::vector<std::string> landmarks_;
  std::vector<std::string> probe_direction_;
};

}  // namespace usct::tools
