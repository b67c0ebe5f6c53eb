#include <itkTxtTransformIO.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "io/bytes.h"
#include "io/results/itk_transform_files.h"
#include "text.h"

namespace usct::io {
namespace {

/// Throws InputError unless `parameters` are as many finite numbers as a linear transform of this
/// type needs. ITK reads them up to what is no number, and then uses what is beyond their end.
void require_parameters(std::string_view parameters, const std::string& type,
                        const std::string& source) {
  const std::vector<double> values = parse_doubles(parameters, source, "Parameters");
  const std::size_t count = values.size();
  const itk::LightObject::Pointer object = itk::ObjectFactoryBase::CreateInstance(type.c_str());
  const auto* transform = dynamic_cast<const AnyTransform*>(object.GetPointer());
  if (transform == nullptr || !transform->IsLinear()) return;
  if (count < transform->GetNumberOfParameters())
    throw InputError(source, "'Parameters' has " + std::to_string(count) + " numbers, a " + type +
                                 " needs " + std::to_string(transform->GetNumberOfParameters()));
  // The vector part of a unit quaternion, which ITK would cut down to a half turn.
  constexpr double kMostVersor = 1.0 + 1e-6;
  const bool is_versor =
      type.find("Versor") != std::string::npos || type.find("Similarity3D") != std::string::npos;
  if (is_versor && std::hypot(values[0], values[1], values[2]) > kMostVersor)
    throw InputError(source, "'Parameters' of a " + type +
                                 " begin with a versor longer than 1, which is no rotation");
}

/// Throws InputError for a text file that ends before its parameters, which ITK would read as the
/// identity without an error, or whose parameters are not complete.
void require_complete_text(const std::filesystem::path& path) {
  const Bytes bytes = read_bytes(path);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  int transforms = 0;
  int parameters = 0;
  int fixed_parameters = 0;
  std::string type;
  for (const std::string_view line : split(text, '\n')) {
    const std::size_t colon = std::min(line.find(':'), line.size());
    const std::string_view name = line.substr(0, colon);
    const std::string_view value = trimmed(line.substr(std::min(colon + 1, line.size())));
    if (name == "Transform") type = value;
    if (name == "Parameters") require_parameters(value, type, path.string());
    const bool composite = line.find("CompositeTransform") != std::string_view::npos;
    transforms += name == "Transform" && !composite ? 1 : 0;
    parameters += name == "Parameters" ? 1 : 0;
    fixed_parameters += name == "FixedParameters" ? 1 : 0;
  }
  if (transforms == 0) throw InputError(path.string(), "is not an ITK transform file");
  if (parameters != transforms || fixed_parameters != transforms)
    throw InputError(path.string(), "has " + std::to_string(transforms) + " transforms, but " +
                                        std::to_string(parameters) + " 'Parameters' and " +
                                        std::to_string(fixed_parameters) + " 'FixedParameters'");
}

TransformIo text_io() { return itk::TxtTransformIOTemplate<double>::New().GetPointer(); }

LinearMap read(const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  require_complete_text(path);
  return read_by(text_io(), path);
}

void write(const LinearMap& map, const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  write_by(text_io(), map, path);
}

}  // namespace
}  // namespace usct::io

extern "C" const void* usct_module() {
  static const usct::io::TextTransformFiles functions{{usct::io::read, usct::io::write}};
  return &functions;
}
