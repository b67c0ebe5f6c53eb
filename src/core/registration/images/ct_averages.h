#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "similarity/packed_ct.h"
#include "us_ct_registration/registration/prepared_ct.h"
#include "us_ct_registration/volume/operations.h"

/// Averages of a CT to the spacings of levels. The blocks of voxels that are averaged divide the
/// whole CT. A region of an average therefore has the same bits, whether it is cut out of the
/// average of the whole CT or averaged by itself.
namespace usct::registration {

/// As the steps of a ReachedAverage; empty where no average is needed.
using AveragingSteps = std::vector<Eigen::Vector3i>;

/// The step to about the spacing; unset: each voxel is its own average.
AveragingSteps steps_to(const std::optional<double>& spacing_mm, const Grid& ct);
/// The steps to the spacing of each level, coarse levels from fine ones. Empty for levels whose
/// similarity uses the recorded CT.
std::vector<AveragingSteps> steps_of(const std::vector<LevelOptions>& levels, const Grid& ct);

/// Grid of the average of a whole CT.
Grid averaged_grid(const Grid& ct, const AveragingSteps& steps);

/// The regions of averages that cover a region of the CT, with a voxel more around them, and that
/// coarser averages are made of.
/// `steps` as from `steps_of`, for one level at least. The CT has 4 voxels at least along each
/// axis.
std::vector<Region> regions_over(const Region& region, const std::vector<AveragingSteps>& steps,
                                 const Grid& ct);

/// The regions of averages.
std::vector<Volume<float>> averaged(const CtVolume& ct, const std::vector<AveragingSteps>& steps,
                                    const std::vector<Region>& regions, const Check& check = {});

/// The averages over a region of the CT, packed; null where no average is needed. Those that are
/// prepared are cut out, the others are made.
std::vector<std::shared_ptr<const PackedCt>> packed_cts(const PreparedCt& ct, const Region& region,
                                                        const std::vector<AveragingSteps>& steps,
                                                        const RegistrationOptions& options,
                                                        const Check& check = {});

}  // namespace usct::registration
