#pragma once

#include <cstddef>

namespace usct {

/// Replaces values by their square roots, rounded as std::sqrt does. The compiler does not use
/// vectors for std::sqrt, since it may set errno.
void take_square_roots(float* values, std::size_t count);

}  // namespace usct
