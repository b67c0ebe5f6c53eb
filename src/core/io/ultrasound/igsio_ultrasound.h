#pragma once

#include <filesystem>
#include <string>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Entries of tracked sequences in the table of formats: see UltrasoundFormat and
/// FileFormat::describe.
namespace usct {

/// Frames before scan conversion need a probe and become a PreScanVolume. B-mode images become
/// TrackedImages; or a PreScanVolume, resampled along the beams, if the probe, its place in the
/// image and the number of samples are given (all of them or none).
UltrasoundInput read_igsio_ultrasound(const UltrasoundSource& source);

/// Throws InputError for a motorised sweep.
void write_igsio_beams(const PreScanVolume& volume, const std::filesystem::path& path);

std::string describe_igsio(const std::filesystem::path& path);

}  // namespace usct
