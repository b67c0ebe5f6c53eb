#include "io/yaml_keys.h"

#include <vector>

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {

YAML::Node parse_yaml(const std::string& text, const std::string& source) {
  std::vector<YAML::Node> documents;
  try {
    documents = YAML::LoadAll(text);
  } catch (const YAML::Exception& error) {
    throw InputError(source, std::string("is not valid YAML: ") + error.what());
  }
  if (documents.size() > 1)
    throw InputError(source, "has " + std::to_string(documents.size()) +
                                 " documents, separated by '---', must have one");
  return documents.empty() ? YAML::Node() : documents.front();
}

YAML::Node read_yaml(const std::filesystem::path& path) {
  const Bytes bytes = read_text_bytes(path);
  return parse_yaml(std::string(bytes.begin(), bytes.end()), path.string());
}

std::string yaml_scalar(const YAML::Node& node, const std::string& source,
                        const std::string& path) {
  if (!node.IsScalar()) throw InputError(source, "'" + path + "' must be a single value");
  return node.Scalar();
}

YamlKeys::YamlKeys(const YAML::Node& map, std::string source, std::string path)
    : source_(std::move(source)), path_(std::move(path)) {
  const std::string what = path_.empty() ? "" : "'" + path_ + "' ";
  if (!map.IsMap()) throw InputError(source_, what + "must be a list of 'key: value'");
  for (const auto& entry : map) {
    if (!entry.first.IsScalar())
      throw InputError(source_,
                       what + "has the key " + in_quotes(YAML::Dump(entry.first)) +
                           ", must be a single word, as in 'key: value', without braces around it");
    const std::string& key = entry.first.Scalar();
    if (!nodes_.emplace(key, entry.second).second)
      throw InputError(source_, "key " + in_quotes(path_of(key)) + " is given twice");
  }
}

std::vector<std::string> YamlKeys::all() const {
  std::vector<std::string> keys;
  for (const auto& [key, node] : nodes_) keys.push_back(key);
  return keys;
}

const YAML::Node& YamlKeys::node(const std::string& key) {
  used_.insert(key);
  const auto it = nodes_.find(key);
  if (it == nodes_.end()) throw InputError(source_, "key '" + path_of(key) + "' is missing");
  return it->second;
}

std::string YamlKeys::text(const std::string& key) {
  return yaml_scalar(node(key), source_, path_of(key));
}

double YamlKeys::number(const std::string& key) {
  return parse_double(text(key), source_, path_of(key));
}

int YamlKeys::whole_number(const std::string& key) {
  return parse_int(text(key), source_, path_of(key));
}

std::optional<double> YamlKeys::optional_number(const std::string& key) {
  return has(key) ? std::optional<double>(number(key)) : std::nullopt;
}

std::vector<double> YamlKeys::table(const std::string& key) {
  const YAML::Node& list = node(key);
  const auto refuse = [&] {
    throw InputError(source_, "'" + path_of(key) + "' must be a list of numbers");
  };
  if (!list.IsSequence()) refuse();
  std::vector<double> values;
  for (const auto& entry : list) {
    if (!entry.IsScalar()) refuse();
    values.push_back(parse_double(entry.Scalar(), source_, path_of(key)));
  }
  return values;
}

void YamlKeys::refuse_unknown(const std::string& hint) const {
  for (const auto& [key, node] : nodes_)
    if (used_.count(key) == 0)
      throw InputError(source_, "key " + in_quotes(path_of(key)) + " is unknown" + hint);
}

}  // namespace usct::io
