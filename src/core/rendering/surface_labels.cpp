#include "us_ct_registration/rendering/surface_labels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>

#include "us_ct_registration/error.h"

namespace usct {

std::map<int, std::string> parse_label_names(const std::string& text, const std::string& source) {
  std::map<int, std::string> names;
  std::istringstream entries(text);
  for (std::string entry; std::getline(entries, entry, ';');) {
    std::istringstream words(entry);
    int label = 0;
    std::string name;
    const bool is_read = static_cast<bool>(words >> label >> std::ws) &&
                         static_cast<bool>(std::getline(words, name));
    if (!is_read || label < 1 || label > std::numeric_limits<std::uint16_t>::max())
      throw InputError(source, "has the entry '" + entry +
                                   "', must be a number in [1, 65535] and a name, like '1 kidney'");
    name.erase(name.find_last_not_of(' ') + 1);
    if (!names.emplace(label, name).second)
      throw InputError(source, "names label " + std::to_string(label) + " twice");
  }
  return names;
}

std::string label_text(int label, const std::map<int, std::string>& names) {
  const auto name = names.find(label);
  return std::to_string(label) + " " + (name == names.end() ? "label" : name->second);
}

/// Steps of the golden ratio around the circle of hues give distinct colours for any number of
/// labels.
std::array<float, 3> label_colour(int label) {
  constexpr double kGoldenRatio = 0.618033988749895;
  const double hue = 6.0 * std::fmod(kGoldenRatio * label, 1.0);
  const auto channel = [hue](double shift) {
    const double k = std::fmod(hue + shift, 6.0);
    return static_cast<float>(1.0 - 0.7 * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

}  // namespace usct
