#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

/// Names and colours of the labels of a label map, which itself has only their numbers.
namespace usct {

struct LabelStyle {
  std::string name;
  /// Red, green and blue in [0, 1]; unset: `label_colour` chooses one.
  std::optional<std::array<float, 3>> colour;
};

/// By label.
using LabelTable = std::map<int, LabelStyle>;

/// Reads a YAML file of one line per label:
///
///     1: {name: kidney, colour: [0.8, 0.4, 0.3]}
///     2: {name: tumour}
///
/// Throws InputError, naming the file and the key: if it is not such a file, a label is not in
/// [1, 65535], a name is empty or given twice, or a colour is not three numbers in [0, 1].
LabelTable read_label_table(const std::filesystem::path& path);

/// "NUMBER NAME"; the name is "label" for a label that is not in the table.
std::string label_text(int label, const LabelTable& table);

/// Red, green and blue in [0, 1] as in the table; for other labels one by their number, such that
/// neighbouring numbers differ clearly.
std::array<float, 3> label_colour(int label, const LabelTable& table);

}  // namespace usct
