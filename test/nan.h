#pragma once

#include <limits>

namespace usct::test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace usct::test
