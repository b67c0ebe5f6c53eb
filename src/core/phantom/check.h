#pragma once

#include <cmath>
#include <string>

#include "us_ct_registration/error.h"

namespace usct::phantom {

inline std::string number_text(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (!text.empty() && text.back() == '.') text.pop_back();
  return text;
}

/// Throws InputError unless `value` is finite and within [low, high].
inline void require_range(const std::string& option, double value, double low, double high) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  throw InputError("phantom options", "'" + option + "' is " + number_text(value) +
                                          ", must be within [" + number_text(low) + ", " +
                                          number_text(high) + "]");
}

}  // namespace usct::phantom
