#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "us_ct_registration/error.h"

namespace usct::tools {

/// The text of an error, in which each key of the core's options, such as 'series_uid', is followed
/// by the option of the chosen command that sets it: 'series_uid' (--series). The core names keys,
/// which are those of files and of ROS parameters; on the command line they have other names.
std::string with_option_names(const CLI::App& app, const InputError& error);

}  // namespace usct::tools
