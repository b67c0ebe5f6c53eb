#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>

namespace usct::ros_interface {

/// Forgets the oldest of more than 16 results by their ids, which rise with time, but not those
/// that are in use: an alignment may count for as long as many more registrations take.
template <typename Result>
void forget_old(std::map<std::uint64_t, Result>& results, const std::set<std::uint64_t>& in_use) {
  constexpr std::size_t kMost = 16;
  for (auto one = results.begin(); one != results.end() && results.size() > kMost;)
    one = in_use.count(one->first) > 0 ? std::next(one) : results.erase(one);
}

}  // namespace usct::ros_interface
