#pragma once

#include <string>
#include <vector>

namespace usct {

/// Throws InputError, naming `source` and `field`, if there are fewer than two values, a value is
/// not finite, or the values are neither strictly rising nor strictly falling.
void require_monotonic(const std::vector<double>& values, const std::string& source,
                       const std::string& field);

/// A strictly monotonic table of positions (angles of lines or frames, positions of elements) that
/// is read at continuous indices: interpolated linearly between entries, and extrapolated with the
/// slope of the outermost pair beyond them. `index_of` is the exact inverse of `at`.
class MonotonicTable {
 public:
  /// Throws InputError as `require_monotonic`.
  MonotonicTable(std::vector<double> values, const std::string& source, const std::string& field);

  double at(double index) const;
  double index_of(double value) const;

 private:
  std::vector<double> values_;
  bool rising_;
  double mean_slope_inverse_;  // entries per unit of value
};

/// Value of `MonotonicTable::at` for a table that is known to be valid (two entries or more).
double interpolate_table(const std::vector<double>& values, double index);

/// `count` values spaced by `pitch` and centred on zero: (i - (count - 1) / 2) * pitch.
std::vector<double> centred_table(int count, double pitch);

}  // namespace usct
