#pragma once

#include "us_ct_registration/progress.h"

namespace usct::phantom {

/// Progress of a part of the work, from `begin` to `end` of the whole.
inline Progress stage(const Progress& progress, double begin, double end) {
  if (!progress) return {};
  return [=](double fraction) { progress(begin + fraction * (end - begin)); };
}

}  // namespace usct::phantom
