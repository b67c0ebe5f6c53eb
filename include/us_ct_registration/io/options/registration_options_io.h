#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/registration/registration.h"

/// RegistrationOptions as YAML. docs/registration_options.md lists every key; keys carry units,
/// angles are in degrees. `none` is an option that is not set, `.inf` is infinite.
///
/// A file either has every key, or begins with `preset: NAME` and then holds only what it changes.
/// There `search.levels` is a list of whole levels that replaces those of the preset, or a map that
/// changes some of them, numbered from 0: `levels: {1: {spacing_mm: 1.5}, 0: none}` changes one key
/// of the second level and leaves out the first. A similarity whose `kind` changes needs all keys
/// of the new kind.
namespace usct {

/// Throws InputError, naming file and path of the key (`search.levels[1].optimizer.initial_step`),
/// for a key that is unknown, missing, given twice, of the wrong type, or out of range.
RegistrationOptions read_registration_options(const std::filesystem::path& path);

/// The same from text; `source` names it in messages.
RegistrationOptions parse_registration_options(const std::string& yaml, const std::string& source);

/// Every key. Numbers come back bit by bit, angles to their last digits.
std::string registration_options_yaml(const RegistrationOptions& options);

/// Every key by its path with its value as text, as RegistrationResult::options.
std::map<std::string, std::string> registration_options_text(const RegistrationOptions& options);

/// The names of the options that come with the library (config/presets/), in alphabetical order.
std::vector<std::string> preset_names();

/// Throws InputError, naming the ones that there are, if there is none of the name.
RegistrationOptions preset(const std::string& name);

/// Its file, with comments for readers. Throws as `preset`.
std::string preset_yaml(const std::string& name);

}  // namespace usct
