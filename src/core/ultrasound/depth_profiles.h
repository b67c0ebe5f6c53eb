#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace usct {

/// Statistics of the values of all beams at each depth; NaN where none is known.
struct DepthProfiles {
  std::vector<double> mean;
  std::vector<double> median;
};

/// `values`: samples x beams, `count` in all. `known`: 0 where a value is not known; empty if all
/// are.
DepthProfiles depth_profiles(const float* values, std::size_t count,
                             const std::vector<std::uint8_t>& known, std::size_t samples);

}  // namespace usct
