#pragma once

#include <optional>

namespace usct {

/// Measures the most memory that the process holds from construction on. One at a time: a process
/// has a single peak.
class PeakMemory {
 public:
  PeakMemory();
  /// The peak less what was held at the construction, MiB; none where Linux does not tell.
  std::optional<double> mib() const;

 private:
  std::optional<double> before_mib_;
};

}  // namespace usct
