#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include "us_ct_registration/error.h"

namespace usct {

/// Throws InputError unless `holds`; `constraint` reads "> 0", "within [0, 1]", ...
inline void require(bool holds, const std::string& source, const std::string& field, double value,
                    const std::string& constraint) {
  if (holds) return;
  std::ostringstream text;
  text << "'" << field << "' is " << value << ", must be " << constraint;
  throw InputError(source, text.str());
}

inline bool is_positive(double value) { return std::isfinite(value) && value > 0.0; }
inline bool is_not_negative(double value) { return std::isfinite(value) && value >= 0.0; }

inline void require_positive(const std::string& source, const std::string& field, double value) {
  require(is_positive(value), source, field, value, "finite and > 0");
}

inline void require_not_negative(const std::string& source, const std::string& field,
                                 double value) {
  require(is_not_negative(value), source, field, value, "finite and >= 0");
}

inline void require_within(const std::string& source, const std::string& field, double value,
                           double low, double high) {
  std::ostringstream range;
  range << "within [" << low << ", " << high << "]";
  require(value >= low && value <= high, source, field, value, range.str());
}

}  // namespace usct
