#pragma once

namespace usct::tools {

/// Exit statuses of `usct`; part of its stable interface.
constexpr int kDone = 0;
/// An unforeseen failure: a defect, or a machine out of memory or disk space.
constexpr int kFailed = 1;
/// Bad arguments or bad input.
constexpr int kBadInput = 2;
/// Not registered: the status of the result is low_confidence, no_overlap or failed.
constexpr int kRefused = 3;

}  // namespace usct::tools
