#pragma once

#include <cmath>
#include <string>

#include "us_ct_registration/formatted.h"

/// Texts of the cells of tables; "-" for what is unknown.
namespace usct {

inline std::string number_cell(double value, int decimals = 2) {
  return std::isfinite(value) ? formatted("%.*f", decimals, value) : "-";
}

inline std::string percent_cell(double share) { return number_cell(100.0 * share, 1); }

inline std::string range_name(double low_mm, double high_mm) {
  return formatted("%g-%g mm", low_mm, high_mm);
}

}  // namespace usct
