#pragma once

#include <cstdint>
#include <vector>

#include "phantom/deformation.h"
#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/phantom/sweep.h"
#include "us_ct_registration/phantom/ultrasound_options.h"
#include "us_ct_registration/progress.h"

namespace usct::phantom {

/// Maps points of the probe frame, where the anatomy lies without breathing, to the coordinates of
/// a frame, in whose image the anatomy is displaced by breathing.
Eigen::Isometry3d T_frame_rest(const Placement& placement, const Acquisition& acquisition,
                               int frame);

/// The envelope of the received signal before compression: samples x lines x frames, samples
/// fastest, linear; the speckle of renal cortex has a root mean square of 1 if gain and TGC are
/// right.
std::vector<float> form_echoes(const Scene& scene, const Placement& placement,
                               const Acquisition& acquisition, const UltrasoundOptions& options,
                               std::uint64_t seed, const Progress& progress = {});

}  // namespace usct::phantom
