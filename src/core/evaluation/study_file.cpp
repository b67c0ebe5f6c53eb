#include "us_ct_registration/evaluation/study_file.h"

#include <fnmatch.h>

#include <algorithm>

#include "io/options/options_reader.h"
#include "require.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using io::YamlKeys;

/// Reads the value of a key, if it is there.
template <typename T>
void read_optional(YamlKeys& keys, const std::string& key, T& value) {
  if (keys.has(key)) io::read({keys.node(key), keys.source(), keys.path_of(key), false}, value);
}

std::vector<std::string> read_words(YamlKeys& keys, const std::string& key) {
  if (!keys.has(key)) return {};
  const YAML::Node& list = keys.node(key);
  if (!list.IsSequence() || list.size() == 0)
    throw InputError(keys.source(),
                     "'" + keys.path_of(key) + "' must be a list of at least 1 word");
  std::vector<std::string> words;
  for (std::size_t i = 0; i < list.size(); ++i)
    words.push_back(
        io::yaml_scalar(list[i], keys.source(), io::path_of_entry(keys.path_of(key), i)));
  return words;
}

bool matches(const std::string& pattern, const fs::path& folder) {
  return fs::is_directory(folder) &&
         ::fnmatch(pattern.c_str(), folder.filename().c_str(), FNM_PERIOD) == 0;
}

/// The folders that a list names, those of a pattern in alphabetical order.
std::vector<fs::path> read_folders(YamlKeys& keys, const std::string& key, const fs::path& root) {
  std::vector<fs::path> folders;
  for (const std::string& text : read_words(keys, key)) {
    const fs::path folder = root / text;
    const std::string pattern = folder.filename().string();
    if (pattern.find('*') == std::string::npos) {
      folders.push_back(folder);
      continue;
    }
    // The parent of a name alone is empty, and stands for the current folder.
    const fs::path parent = folder.parent_path();
    const fs::path searched = parent.empty() ? fs::path(".") : parent;
    std::vector<fs::path> found;
    if (fs::is_directory(searched))
      for (const auto& entry : fs::directory_iterator(searched))
        if (matches(pattern, entry.path())) found.push_back(parent / entry.path().filename());
    if (found.empty())
      throw InputError(keys.source(), "'" + keys.path_of(key) + "' has '" + text +
                                          "', must match a folder; there is none in '" +
                                          searched.string() + "'");
    std::sort(found.begin(), found.end());
    folders.insert(folders.end(), found.begin(), found.end());
  }
  return folders;
}

StudyOptions read_starts(const YAML::Node& node, const std::string& source) {
  const std::string path = "starts";
  YamlKeys keys(node, source, path);
  StudyOptions starts;
  read_optional(keys, "count", starts.starts);
  io::with_path(source, path,
                [&] { require(starts.starts >= 1, source, "count", starts.starts, ">= 1"); });
  read_optional(keys, "bins", starts.bins);
  if (keys.has("kinds")) starts.kinds.clear();
  for (const std::string& name : read_words(keys, "kinds"))
    io::with_path(source, keys.path_of("kinds"),
                  [&] { starts.kinds.push_back(parse_kind(name, source)); });
  read_optional(keys, "seeds", starts.seeds);
  io::Reader fields(keys, false);
  fields("min_displacement_mm", starts.min_displacement_mm);
  fields("max_displacement_mm", starts.max_displacement_mm);
  fields.degrees("max_rotation_deg", starts.max_rotation_rad, 180.0);
  for (const char* key : {"box_mm", "box_deg"})
    if (keys.has(key) && !starts.box) starts.box.emplace();
  if (starts.box) {
    fields("box_mm", starts.box->translation_mm);
    fields.degrees("box_deg", starts.box->rotation_rad, 180.0);
    for (const char* other : {"min_displacement_mm", "max_displacement_mm", "max_rotation_deg"})
      if (keys.has(other))
        throw InputError(source, "'" + keys.path_of(other) +
                                     "' is of starts by displacement, must not stand beside a box");
  }
  keys.refuse_unknown();
  io::with_path(source, path, [&] { starts.validate(source); });
  return starts;
}

/// Another metric with its default options, in the same patches if both have some.
SimilarityOptions replaced(const SimilarityOptions& old, SimilarityOptions metric) {
  if (metric.index() == old.index()) return old;
  std::visit(
      [](const auto& from, auto& to) {
        if constexpr (has_patches<decltype(from)> && has_patches<decltype(to)>)
          to.patches = from.patches;
      },
      old, metric);
  return metric;
}

/// The climbs that find the pose: those of the search and the refinement.
std::vector<ClimbOptions*> climbs_of(RegistrationOptions& options) {
  std::vector<ClimbOptions*> climbs;
  for (LevelOptions& level : options.search.levels) climbs.push_back(&level);
  if (options.refinement) climbs.push_back(&*options.refinement);
  return climbs;
}

/// The method with each of the metrics and optimizers; as it is where there are none.
std::vector<StudyMethod> combined(const StudyMethod& method,
                                  const std::vector<SimilarityOptions>& metrics,
                                  const std::vector<OptimizerMethod>& optimizers) {
  std::vector<StudyMethod> methods{method};
  const auto vary = [&](const auto& values, const auto& name_of, const auto& set) {
    if (values.empty()) return;
    std::vector<StudyMethod> varied;
    for (const StudyMethod& base : methods)
      for (const auto& value : values) {
        varied.push_back(base);
        varied.back().name += std::string("+") + name_of(value);
        for (ClimbOptions* climb : climbs_of(varied.back().options)) set(*climb, value);
      }
    methods = varied;
  };
  vary(metrics, similarity_name, [](ClimbOptions& climb, const SimilarityOptions& metric) {
    climb.similarity = replaced(climb.similarity, metric);
  });
  vary(optimizers, method_name,
       [](ClimbOptions& climb, OptimizerMethod optimizer) { climb.optimizer.method = optimizer; });
  return methods;
}

std::vector<StudyMethod> read_method(const YAML::Node& node, const std::string& source,
                                     const std::string& path) {
  YamlKeys keys(node, source, path);
  StudyMethod method;
  const std::string name = keys.text("preset");
  io::with_path(source, keys.path_of("preset"), [&] { method.options = preset(name); });
  method.name = keys.has("name") ? keys.text("name") : name;
  read_optional(keys, "options", method.options);
  read_optional(keys, "parallel_beams_mm", method.parallel_beams_mm);
  bool judged = true;
  read_optional(keys, "judged", judged);
  if (!judged) method.options.confidence.gates = GateLimits::none();
  std::vector<SimilarityOptions> metrics;
  for (const std::string& word : read_words(keys, "metrics"))
    io::with_path(source, keys.path_of("metrics"),
                  [&] { metrics.push_back(similarity_named(word, source)); });
  std::vector<OptimizerMethod> optimizers;
  read_optional(keys, "optimizers", optimizers);
  keys.refuse_unknown();
  return combined(method, metrics, optimizers);
}

}  // namespace

Study read_study(const fs::path& path, const fs::path& root) {
  const std::string source = path.string();
  YamlKeys keys(io::read_yaml(path), source);
  const fs::path folder = root.empty() ? path.parent_path() : root;
  Study study;
  study.cases = read_folders(keys, "cases", folder);
  if (study.cases.empty()) throw InputError(source, "key 'cases' is missing");
  study.strangers = read_folders(keys, "strangers", folder);
  const YAML::Node& methods = keys.node("methods");
  if (!methods.IsSequence()) throw InputError(source, "'methods' must be a list");
  for (std::size_t i = 0; i < methods.size(); ++i)
    for (StudyMethod& method : read_method(methods[i], source, io::path_of_entry("methods", i)))
      study.methods.push_back(std::move(method));
  if (keys.has("starts")) study.starts = read_starts(keys.node("starts"), source);
  read_optional(keys, "success_mm", study.success_mm);
  bool one_at_a_time = false;
  read_optional(keys, "one_at_a_time", one_at_a_time);
  if (one_at_a_time) study.how = StudyThreads::kWithinTrial;
  keys.refuse_unknown();
  study.validate(source);
  return study;
}

}  // namespace usct
