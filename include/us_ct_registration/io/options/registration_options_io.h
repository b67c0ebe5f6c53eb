#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/registration/registration.h"

/// RegistrationOptions as YAML. docs/registration_options.md lists every key. Keys carry units;
/// angles are in degrees. `none` stands for an option that is not set, `.inf` for infinity.
///
/// A file either has every key, or begins with `preset: NAME` and then holds only the keys that it
/// changes. In such a file `search.levels` is either a list of whole levels that replaces those of
/// the preset, or a map that changes some of them, numbered from 0: `levels: {1: {spacing_mm: 1.5},
/// 0: none}` changes one key of the second level and leaves out the first. A similarity whose
/// `kind` changes needs all keys of the new kind.
namespace usct {

/// Throws InputError, naming file and path of the key (`search.levels[1].optimizer.initial_step`),
/// for a key that is unknown, missing, given twice, of the wrong type, or out of range.
RegistrationOptions read_registration_options(const std::filesystem::path& path);

/// Parses the same YAML from text; `source` names the text in messages.
RegistrationOptions parse_registration_options(const std::string& yaml, const std::string& source);

/// All options with every key. Numbers are read back bit by bit, angles to their last digits.
std::string registration_options_yaml(const RegistrationOptions& options);

/// The value of every option as text, by the path of its key, as in RegistrationResult::options.
std::map<std::string, std::string> registration_options_text(const RegistrationOptions& options);

/// The names of the presets that come with the library (config/presets/), in alphabetical order.
std::vector<std::string> preset_names();

/// The preset with this name. Throws InputError, listing the existing names, for any other name.
RegistrationOptions preset(const std::string& name);

/// The file of a preset, with its comments. Throws as `preset` does.
std::string preset_yaml(const std::string& name);

}  // namespace usct
