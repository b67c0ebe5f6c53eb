#pragma once

#include <array>
#include <map>
#include <string>

/// Names and colours of the labels whose surfaces are shown.
namespace usct {

/// Reads names of labels from a text like "1 kidney; 2 tumour". Throws InputError, naming `source`,
/// for an entry without number or name, and for a number that is not in [1, 65535] or comes twice.
std::map<int, std::string> parse_label_names(const std::string& text, const std::string& source);

/// "NUMBER NAME"; the name is "label" for a label that has none.
std::string label_text(int label, const std::map<int, std::string>& names);

/// Red, green and blue in [0, 1]; labels with neighbouring numbers differ clearly.
std::array<float, 3> label_colour(int label);

}  // namespace usct
