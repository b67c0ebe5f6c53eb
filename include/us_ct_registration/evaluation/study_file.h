#pragma once

#include <filesystem>
#include <string>

#include "us_ct_registration/evaluation/study.h"

/// Studies as YAML files; docs/studies.md lists every key.
namespace usct {

/// Reads a study. Relative folders of cases begin at `root`, or at the file's own folder if that is
/// empty; the last part of a folder may hold '*', which stands for any text, and at least one
/// folder must match. A method with several metrics or optimizers stands for a method for each
/// combination, named NAME+METRIC+OPTIMIZER.
///
/// Throws InputError, naming the file and the path of the key (`methods[1].options.seed`), for a
/// key that is unknown, missing, given twice, of the wrong type, or out of range.
Study read_study(const std::filesystem::path& path, const std::filesystem::path& root = {});

}  // namespace usct
