#include <itk_H5Cpp.h>

#include "io/bytes.h"
#include "io/results/itk_transform_files.h"

namespace usct::io {
namespace {

constexpr const char* kGroup = "TransformGroup";
constexpr const char* kType = "TransformType";
constexpr const char* kParameters = "TransformParameters";
constexpr const char* kFixedParameters = "TransformFixedParameters";
// Older versions of ITK misspell them.
constexpr const char* kOlderParameters = "TranformParameters";
constexpr const char* kOlderFixedParameters = "TranformFixedParameters";

/// The one text of a dataset; none if it is anything else. HDF5 gives a null pointer for a text
/// that was lost.
std::optional<std::string> one_text(const H5::DataSet& dataset) {
  const H5::DataSpace space = dataset.getSpace();
  if (dataset.getTypeClass() != H5T_STRING || space.getSimpleExtentNpoints() != 1) return {};
  if (!dataset.getStrType().isVariableStr()) {
    std::string text;
    dataset.read(text, dataset.getStrType());
    return text.substr(0, text.find('\0'));
  }
  const H5::StrType type(H5::PredType::C_S1, H5T_VARIABLE);
  char* text = nullptr;
  dataset.read(&text, type);
  if (text == nullptr) return {};
  std::string result = text;
  H5::DataSet::vlenReclaim(&text, type, space);
  return result;
}

/// The numbers of the dataset with one of two names; none if there is neither.
std::optional<std::vector<double>> numbers(const H5::Group& transform, const char* name,
                                           const char* older_name, const std::string& source) {
  if (!transform.nameExists(name)) name = older_name;
  if (!transform.nameExists(name)) return {};
  const H5::DataSet dataset = transform.openDataSet(name);
  constexpr hssize_t kMost = 1000;  // a damaged file may claim any number
  const hssize_t count = dataset.getSpace().getSimpleExtentNpoints();
  if (count < 0 || count > kMost)
    throw InputError(source, "'" + std::string(name) + "' are " + std::to_string(count) +
                                 " numbers, too many for a linear transform");
  std::vector<double> values(static_cast<std::size_t>(count));
  if (!values.empty()) dataset.read(values.data(), H5::PredType::NATIVE_DOUBLE);
  return values;
}

std::vector<StoredTransform> read_all(const H5::H5File& file, const std::string& source) {
  std::vector<StoredTransform> transforms;
  const H5::Group group = file.openGroup(kGroup);
  for (hsize_t i = 0; i < group.getNumObjs(); ++i) {
    const H5::Group transform = group.openGroup(std::to_string(i));
    const auto type = one_text(transform.openDataSet(kType));
    if (!type)
      throw InputError(source,
                       "is damaged: the name of transform " + std::to_string(i) + " is no text");
    transforms.push_back({*type, {}, {}});
    if (is_composite(*type)) continue;
    new_transform(*type, source);  // refuses a deformation before its many numbers are read
    transforms.back().parameters = numbers(transform, kParameters, kOlderParameters, source);
    transforms.back().fixed_parameters =
        numbers(transform, kFixedParameters, kOlderFixedParameters, source);
  }
  return transforms;
}

LinearMap read(const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  H5::Exception::dontPrint();  // our own message holds HDF5's
  read_prefix(path, 1);        // throws a clear message if the file is missing, empty or a folder
  try {
    return linear_map(read_all(H5::H5File(path.string(), H5F_ACC_RDONLY), path.string()),
                      path.string());
  } catch (const H5::Exception& error) {
    throw InputError(path.string(), kNoTransformFile + error.getDetailMsg());
  }
}

void add_text(const H5::Group& group, const char* name, const std::string& text) {
  const hsize_t one = 1;
  const H5::StrType type(H5::PredType::C_S1, H5T_VARIABLE);
  const char* pointer = text.c_str();
  group.createDataSet(name, type, H5::DataSpace(1, &one)).write(&pointer, type);
}

void add_numbers(const H5::Group& group, const char* name, const std::vector<double>& values) {
  const hsize_t count = values.size();
  group.createDataSet(name, H5::PredType::NATIVE_DOUBLE, H5::DataSpace(1, &count))
      .write(values.data(), H5::PredType::NATIVE_DOUBLE);
}

/// The bytes of the file, made in memory: HDF5 crashes where a disk is full.
Bytes file_image(const LinearMap& map) {
  constexpr std::size_t kBlockBytes = 4096;
  H5::FileAccPropList in_memory;
  in_memory.setCore(kBlockBytes, false);
  const H5::H5File file("transform.h5", H5F_ACC_TRUNC, H5::FileCreatPropList::DEFAULT, in_memory);
  const H5::Group transform = file.createGroup(kGroup).createGroup("0");
  add_text(transform, kType, kWrittenType);
  add_numbers(transform, kParameters, written_parameters(map));
  add_numbers(transform, kFixedParameters, kWrittenCentre);
  file.flush(H5F_SCOPE_GLOBAL);
  Bytes bytes(static_cast<std::size_t>(H5Fget_file_image(file.getId(), nullptr, 0)));
  H5Fget_file_image(file.getId(), bytes.data(), bytes.size());
  return bytes;
}

void write(const LinearMap& map, const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  write_bytes(path, file_image(map));
}

}  // namespace
}  // namespace usct::io

extern "C" const void* usct_module() {
  static const usct::io::Hdf5TransformFiles functions{{usct::io::read, usct::io::write}};
  return &functions;
}
