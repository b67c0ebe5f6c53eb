#include "us_ct_registration/io/volumes/label_table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include "io/yaml_keys.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

int label_of(const std::string& key, const std::string& source) {
  const int label = parse_int(key, source, "label");
  constexpr int kMost = std::numeric_limits<std::uint16_t>::max();
  if (label < 1 || label > kMost)
    throw InputError(source, "label " + key + " must be in [1, " + std::to_string(kMost) + "]");
  return label;
}

std::array<float, 3> colour_of(io::YamlKeys& style) {
  const std::vector<double> values = style.table("colour");
  const bool is_colour =
      values.size() == 3 &&
      std::all_of(values.begin(), values.end(), [](double v) { return v >= 0 && v <= 1; });
  if (!is_colour)
    throw InputError(style.source(),
                     "'" + style.path_of("colour") + "' must be red, green and blue in [0, 1]");
  return {static_cast<float>(values[0]), static_cast<float>(values[1]),
          static_cast<float>(values[2])};
}

}  // namespace

LabelTable read_label_table(const std::filesystem::path& path) {
  const std::string source = path.string();
  io::YamlKeys labels(io::read_yaml(path), source);
  LabelTable table;
  std::set<std::string> names;
  for (const std::string& key : labels.all()) {
    const auto [entry, is_new] = table.emplace(label_of(key, source), LabelStyle());
    if (!is_new) throw InputError(source, "the label '" + key + "' is given twice");
    LabelStyle& style = entry->second;
    io::YamlKeys keys(labels.node(key), source, labels.path_of(key));
    style.name = keys.text("name");
    if (keys.has("colour")) style.colour = colour_of(keys);
    keys.refuse_unknown();
    if (style.name.empty()) throw InputError(source, "'" + keys.path_of("name") + "' is empty");
    if (!names.insert(style.name).second)
      throw InputError(source, "the name '" + style.name + "' is given twice");
  }
  return table;
}

std::string label_text(int label, const LabelTable& table) {
  const auto style = table.find(label);
  return std::to_string(label) + " " + (style == table.end() ? "label" : style->second.name);
}

/// Steps of the golden ratio around the circle of hues give distinct colours for any number of
/// labels.
std::array<float, 3> label_colour(int label, const LabelTable& table) {
  const auto style = table.find(label);
  if (style != table.end() && style->second.colour) return *style->second.colour;
  constexpr double kGoldenRatio = 0.618033988749895;
  const double hue = 6.0 * std::fmod(kGoldenRatio * label, 1.0);
  const auto channel = [hue](double shift) {
    const double k = std::fmod(hue + shift, 6.0);
    return static_cast<float>(1.0 - 0.7 * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

}  // namespace usct
