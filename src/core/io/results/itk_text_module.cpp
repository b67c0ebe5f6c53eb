#include <algorithm>
#include <string_view>

#include "io/bytes.h"
#include "io/results/itk_transform_files.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::io {
namespace {

void put(std::string_view numbers, const std::string& name, const std::string& source,
         std::optional<std::vector<double>>& values) {
  if (values) throw InputError(source, "'" + name + "' are given twice for a transform");
  values = parse_doubles(numbers, source, name);
}

/// Lines "Name: value": a transform is a line `Transform`, and those of its parameters follow.
std::vector<StoredTransform> parse(std::string_view text, const std::string& source) {
  std::vector<StoredTransform> transforms;
  for (const std::string_view whole : split(text, '\n')) {
    const std::string_view line = trimmed(whole);
    if (line.empty() || line.front() == '#') continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos)
      throw InputError(source, kNoTransformFile + "line " + in_quotes(line) + " has no ':'");
    const std::string name(trimmed(line.substr(0, colon)));
    const std::string_view value = trimmed(line.substr(colon + 1));
    if (name == "Transform") {
      transforms.push_back({std::string(value), {}, {}});
      continue;
    }
    if (name == "ComponentTransformFile")
      throw InputError(source, "names the file " + in_quotes(value) +
                                   " for a part of its transform, must hold all of it");
    if (name != "Parameters" && name != "FixedParameters") continue;
    if (transforms.empty())
      throw InputError(source, kNoTransformFile + "'" + name + "' stand before any 'Transform'");
    put(value, name, source,
        name == "Parameters" ? transforms.back().parameters : transforms.back().fixed_parameters);
  }
  return transforms;
}

LinearMap read(const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  const Bytes bytes = read_text_bytes(path);
  return linear_map(parse(text_view(bytes), path.string()), path.string());
}

void write(const LinearMap& map, const std::filesystem::path& path) {
  write_text(path, std::string("#Insight Transform File V1.0\n#Transform 0\nTransform: ") +
                       kWrittenType + "\nParameters: " + format_doubles(written_parameters(map)) +
                       "\nFixedParameters: " + format_doubles(kWrittenCentre) + "\n");
}

}  // namespace
}  // namespace usct::io

extern "C" const void* usct_module() {
  static const usct::io::TextTransformFiles functions{{usct::io::read, usct::io::write}};
  return &functions;
}
