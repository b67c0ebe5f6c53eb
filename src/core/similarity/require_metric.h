#pragma once

#include "require.h"

/// Constraints that the options of several metrics share.
namespace usct {

inline void require_bins(int bins, const std::string& source) {
  require(bins >= 8 && bins <= 128, source, "bins", bins, "within [8, 128]");
}

}  // namespace usct
