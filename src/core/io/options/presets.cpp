#include "io/options/embedded_presets.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct {

std::vector<std::string> preset_names() {
  std::vector<std::string> names;
  for (const auto& [name, yaml] : io::embedded_presets()) names.push_back(name);
  return names;
}

std::string preset_yaml(const std::string& name) {
  const auto it = io::embedded_presets().find(name);
  if (it != io::embedded_presets().end()) return it->second;
  std::string all;
  for (const std::string& known : preset_names()) all += (all.empty() ? "" : ", ") + known;
  throw InputError("preset", "is '" + name + "', must be one of " + all);
}

RegistrationOptions preset(const std::string& name) {
  return parse_registration_options(preset_yaml(name), "preset " + name);
}

}  // namespace usct
