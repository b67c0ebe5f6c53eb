#pragma once

#include <string>

namespace usct {

/// Text with values in it, in the format of printf, which the compiler checks. Any length fits.
std::string formatted(const char* format, ...) __attribute__((format(printf, 1, 2)));

}  // namespace usct
