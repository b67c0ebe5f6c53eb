#include "io/results/itk_transform.h"

#include <itkAffineTransform.h>
#include <itkHDF5TransformIO.h>
#include <itkTransformFactory.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>
#include <itk_H5Cpp.h>

#include <algorithm>
#include <mutex>
#include <string_view>

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::io {
namespace {

using AnyTransform = itk::Transform<double, 3, 3>;
using Affine = itk::AffineTransform<double, 3>;

/// Locks ITK's transform files. Its registry of transforms is global, and its HDF5 library is not
/// safe for threads.
std::unique_lock<std::mutex> lock_itk_transforms() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  static std::once_flag registered;
  std::call_once(registered, [] {
    itk::TransformFactoryBase::RegisterDefaultTransforms();
    // Older versions of ANTs write this transform, which is not among the defaults.
    itk::TransformFactory<itk::MatrixOffsetTransformBase<double, 3, 3>>::RegisterTransform();
    H5::Exception::dontPrint();  // our own message holds HDF5's
  });
  return lock;
}

/// The reader and writer for the extension. It is chosen here and not by ITK's factories, so that
/// no factory has to be registered and those of other libraries cannot interfere.
itk::TransformIOBaseTemplate<double>::Pointer transform_io(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".tfm" || extension == ".txt")
    return itk::TxtTransformIOTemplate<double>::New().GetPointer();
  if (extension == ".h5" || extension == ".hdf5")
    return itk::HDF5TransformIOTemplate<double>::New().GetPointer();
  throw InputError(path.string(), "extension is '" + extension +
                                      "', must be .tfm, .txt, .h5 or .hdf5 (ITK transform)");
}

/// Throws InputError unless `parameters` are as many finite numbers as a linear transform of this
/// type needs. ITK reads them up to what is no number, and then uses what is beyond their end.
void require_parameters(std::string_view parameters, const std::string& type,
                        const std::string& source) {
  const std::size_t count = parse_doubles(parameters, source, "Parameters").size();
  const itk::LightObject::Pointer object = itk::ObjectFactoryBase::CreateInstance(type.c_str());
  const auto* transform = dynamic_cast<const AnyTransform*>(object.GetPointer());
  if (transform == nullptr || !transform->IsLinear()) return;
  if (count < transform->GetNumberOfParameters())
    throw InputError(source, "'Parameters' has " + std::to_string(count) + " numbers, a " + type +
                                 " needs " + std::to_string(transform->GetNumberOfParameters()));
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

/// Throws InputError unless the name of each transform is one text, and H5::Exception if there is
/// none. ITK reads more texts than one beyond the end of a pointer, and follows the null pointer
/// that HDF5 gives for a text that was lost.
void require_names_hdf5(const std::filesystem::path& path) {
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

/// The part of ITK's message that is about the file, not about ITK's source code.
std::string description(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  const std::size_t prefix = text.find("): ");
  if (prefix != std::string::npos) text = text.substr(prefix + 3);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// Runs `action` and turns exceptions of ITK and HDF5 into InputErrors.
template <typename Action>
void with_input_errors(const std::string& source, const Action& action) {
  const std::string violation = "is not an ITK transform file: ";
  try {
    action();
  } catch (const itk::ExceptionObject& error) {
    throw InputError(source, violation + description(error));
  } catch (const H5::Exception& error) {
    throw InputError(source, violation + error.getDetailMsg());
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {  // ITK throws this for some unknown names of transforms
    throw InputError(source, violation + error.what());
  }
}

LinearMap linear_map(const AnyTransform& transform) {
  LinearMap map;
  const AnyTransform::OutputPointType moved =
      transform.TransformPoint(AnyTransform::InputPointType(0.0));
  for (unsigned row = 0; row < 3; ++row) map.translation[row] = moved[row];
  for (unsigned axis = 0; axis < 3; ++axis) {
    AnyTransform::InputVectorType unit(0.0);
    unit[axis] = 1.0;
    const AnyTransform::OutputVectorType column = transform.TransformVector(unit);
    for (unsigned row = 0; row < 3; ++row) map.matrix[row][axis] = column[row];
  }
  return map;
}

}  // namespace

LinearMap read_itk_transform(const std::filesystem::path& path) {
  const std::string source = path.string();
  const auto io = transform_io(path);
  const bool is_text = std::string_view(io->GetNameOfClass()) == "TxtTransformIOTemplate";
  const auto lock = lock_itk_transforms();
  if (is_text)
    require_complete_text(path);
  else
    read_prefix(path, 1);  // throws a clear message if the file is missing, empty or a folder
  if (!is_text) with_input_errors(source, [&] { require_names_hdf5(path); });
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetTransformIO(io);
  reader->SetFileName(source);
  with_input_errors(source, [&] { reader->Update(); });
  const auto* transforms = reader->GetTransformList();
  if (transforms->size() != 1)
    throw InputError(source, "holds " + std::to_string(transforms->size()) +
                                 " transforms, must hold 1 (or one CompositeTransform)");
  const std::string type = transforms->front()->GetTransformTypeAsString();
  const auto* transform = dynamic_cast<const AnyTransform*>(transforms->front().GetPointer());
  if (transform == nullptr || !transform->IsLinear())
    throw InputError(source,
                     "holds a " + type + ", must be a linear transform from 3 to 3 dimensions");
  LinearMap map;
  with_input_errors(source, [&] { map = linear_map(*transform); });
  map.type = type;
  return map;
}

void write_itk_transform(const LinearMap& map, const std::filesystem::path& path) {
  const auto affine = Affine::New();
  Affine::MatrixType matrix;
  Affine::OutputVectorType translation;
  for (unsigned row = 0; row < 3; ++row) {
    for (unsigned column = 0; column < 3; ++column) matrix(row, column) = map.matrix[row][column];
    translation[row] = map.translation[row];
  }
  affine->SetMatrix(matrix);
  affine->SetTranslation(translation);
  const auto io = transform_io(path);
  const auto lock = lock_itk_transforms();
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    writer->SetTransformIO(io);
    writer->SetFileName(temporary.string());
    writer->SetInput(affine);
    writer->Update();
  });
}

}  // namespace usct::io
