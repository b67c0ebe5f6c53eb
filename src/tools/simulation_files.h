#pragma once

#include <filesystem>

#include "us_ct_registration/simulation/simulation.h"
#include "us_ct_registration/ultrasound/conditioning.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

/// The files that `usct simulate` writes.
namespace usct::tools {

/// Everything that the simulation of one acquisition computed.
struct Simulation {
  const UltrasoundBeams& beams;
  const ConditionedUltrasound& conditioned;
  const SimulatedComponents& components;
  const SimulatedUltrasound& simulated;
  const SimulationOptions& options;
  /// The normalisation of the ultrasound to which `simulated` was fitted.
  Normalisation fit_to;
};

/// Writes into `folder`, which must exist: the images, flags and exclusions as the
/// ultrasound is stored (NRRD); the pictures `frame.png` (only for ultrasound with a probe's
/// geometry) and `frame_beams.png` of one frame, with `pixel_mm` per pixel; and `simulation.json`.
void write_simulation(const Simulation& simulation, int frame, double pixel_mm,
                      const std::filesystem::path& folder);

}  // namespace usct::tools
