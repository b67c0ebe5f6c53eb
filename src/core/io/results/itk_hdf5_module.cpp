#include <itkHDF5TransformIO.h>
#include <itk_H5Cpp.h>

#include "io/bytes.h"
#include "io/results/itk_transform_files.h"

namespace usct::io {
namespace {

/// Throws InputError unless the name of each transform is one text, and H5::Exception if there is
/// none. ITK reads more texts than one beyond the end of a pointer, and follows the null pointer
/// that HDF5 gives for a text that was lost.
void require_names(const std::filesystem::path& path) {
  const H5::H5File file(path.string(), H5F_ACC_RDONLY);
  const H5::Group transforms = file.openGroup("TransformGroup");
  for (hsize_t i = 0; i < transforms.getNumObjs(); ++i) {
    const H5::DataSet name = transforms.openGroup(std::to_string(i)).openDataSet("TransformType");
    const H5::DataSpace space = name.getSpace();
    bool is_text = name.getTypeClass() == H5T_STRING && space.getSimpleExtentNpoints() == 1;
    if (is_text && name.getStrType().isVariableStr()) {
      const H5::StrType type(H5::PredType::C_S1, H5T_VARIABLE);
      char* text = nullptr;
      name.read(&text, type);
      is_text = text != nullptr;
      if (is_text) H5::DataSet::vlenReclaim(&text, type, space);
    }
    if (!is_text)
      throw InputError(path.string(),
                       "is damaged: the name of transform " + std::to_string(i) + " is no text");
  }
}

TransformIo hdf5_io() {
  H5::Exception::dontPrint();  // our own message holds HDF5's
  return itk::HDF5TransformIOTemplate<double>::New().GetPointer();
}

LinearMap read(const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  read_prefix(path, 1);  // throws a clear message if the file is missing, empty or a folder
  const TransformIo io = hdf5_io();
  try {
    require_names(path);
    return read_by(io, path);
  } catch (const H5::Exception& error) {
    throw InputError(path.string(), kNoTransformFile + error.getDetailMsg());
  }
}

void write(const LinearMap& map, const std::filesystem::path& path) {
  const auto lock = lock_itk_transforms();
  write_by(hdf5_io(), map, path);
}

}  // namespace
}  // namespace usct::io

extern "C" const void* usct_module() {
  static const usct::io::Hdf5TransformFiles functions{{usct::io::read, usct::io::write}};
  return &functions;
}
