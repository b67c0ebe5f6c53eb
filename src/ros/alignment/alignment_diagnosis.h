#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <string>

#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct::ros_interface {

/// Fills the diagnostics of the alignment: what is broadcast or why nothing is, and what waits.
/// `last_refusal` and `file_error`: the last result that was refused and the problem of the
/// alignment's file, in words; empty if there is none.
void describe(const AlignmentDecisions& decisions, const std::string& last_refusal,
              const std::string& file_error, diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace usct::ros_interface
