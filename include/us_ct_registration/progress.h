#pragma once

#include <functional>

namespace usct {

/// Receives the fraction of the work that is done, in [0, 1], never from two threads at once. An
/// empty function means that nobody listens. It may throw to cancel: the exception reaches the
/// caller of the work.
using Progress = std::function<void(double fraction)>;

/// Called between the parts of long work, possibly from several threads at once; it may throw to
/// cancel. An empty function means that nobody cancels.
using Check = std::function<void()>;

}  // namespace usct
