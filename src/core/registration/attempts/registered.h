#pragma once

#include <optional>

#include "registration/attempts/trail.h"
#include "us_ct_registration/registration/registration_result.h"

namespace usct::registration {

/// A registration, and what it leaves for the next one.
struct Registration {
  RegistrationResult result;
  /// A full registration leaves one if it was accepted and has evidence on its own images.
  std::optional<Trail> trail;
  /// Whether the registration went on as the preset `patient`.
  bool by_patient = false;
  /// Whether matched blocks found the pose: `similarity` is then that of their search.
  bool by_matched_blocks = false;
  /// Whether the pose was tracked, without a search.
  bool was_tracked = false;
};

}  // namespace usct::registration
