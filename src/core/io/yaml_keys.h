#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace usct::io {

/// The keys of a YAML map. The reader asks for each key by name, and refuses all other keys.
///
/// Errors are InputErrors that name the source and the whole path of the key, such as
/// `search.levels[1].optimizer.initial_step`.
class YamlKeys {
 public:
  /// `path` is the path of the map, empty for a whole file. Throws unless the node is a map whose
  /// keys are different texts.
  YamlKeys(const YAML::Node& map, std::string source, std::string path = "");

  const std::string& source() const { return source_; }
  /// Path of a key, for messages, and for the YamlKeys of a map under this key.
  std::string path_of(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }
  bool has(const std::string& key) const { return nodes_.count(key) != 0; }
  /// All keys, in alphabetical order.
  std::vector<std::string> all() const;

  /// These throw if the key is missing, or not of the right type.
  const YAML::Node& node(const std::string& key);
  std::string text(const std::string& key);
  double number(const std::string& key);
  int whole_number(const std::string& key);
  std::vector<double> table(const std::string& key);
  std::optional<double> optional_number(const std::string& key);

  /// Throws InputError if the map has a key that was not asked for; `hint` ends the message.
  void refuse_unknown(const std::string& hint = "") const;

 private:
  std::string source_;
  std::string path_;
  std::map<std::string, YAML::Node> nodes_;
  std::set<std::string> used_;
};

/// Throws InputError, naming `source`, if the text is not YAML.
YAML::Node parse_yaml(const std::string& text, const std::string& source);

/// Throws InputError as `read_bytes` and `parse_yaml`.
YAML::Node read_yaml(const std::filesystem::path& path);

/// Throws InputError, naming the path, unless the node is a single value.
std::string yaml_scalar(const YAML::Node& node, const std::string& source, const std::string& path);

}  // namespace usct::io
