#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace usct {

/// Throws InputError, naming `source` and `field`, unless `times_s` is empty, or has one finite
/// entry per frame and never falls.
void require_frame_times(const std::vector<double>& times_s, std::size_t frames,
                         const std::string& source, const std::string& field);

}  // namespace usct
