#include "us_ct_registration/io/options/registration_options_io.h"

#include "io/options/options_reader.h"
#include "io/options/options_writer.h"

namespace usct {
namespace io {
namespace {

RegistrationOptions read_root(const YAML::Node& root, const std::string& source) {
  YamlKeys keys(root, source);
  const bool derived = keys.has("preset");
  RegistrationOptions options;
  if (derived) {
    const std::string name = keys.text("preset");
    with_path(source, "preset", [&] { options = preset(name); });
  }
  read_struct(keys, "", !derived, options);
  return options;
}

}  // namespace
}  // namespace io

RegistrationOptions read_registration_options(const std::filesystem::path& path) {
  return io::read_root(io::read_yaml(path), path.string());
}

RegistrationOptions parse_registration_options(const std::string& yaml, const std::string& source) {
  return io::read_root(io::parse_yaml(yaml, source), source);
}

std::string registration_options_yaml(const RegistrationOptions& options) {
  RegistrationOptions copy = options;  // reading shares the description, so it takes non-const
  std::string text;
  io::Writer fields(text, 0);
  io::describe(fields, copy);
  return text;
}

std::map<std::string, std::string> registration_options_text(const RegistrationOptions& options) {
  RegistrationOptions copy = options;
  std::map<std::string, std::string> list;
  io::Lister fields(list, "");
  io::describe(fields, copy);
  return list;
}

}  // namespace usct
