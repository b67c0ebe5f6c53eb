#pragma once

#include <string>

#include "require.h"

namespace usct::phantom {

/// Throws InputError unless `value` is within [low, high].
inline void require_range(const std::string& option, double value, double low, double high) {
  require_within("phantom options", option, value, low, high);
}

}  // namespace usct::phantom
