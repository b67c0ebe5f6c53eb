#include "io/itk_transform.h"

#include <itkAffineTransform.h>
#include <itkHDF5TransformIO.h>
#include <itkTransformFactoryBase.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>

#include <mutex>

#include "io/bytes.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::io {
namespace {

using AnyTransform = itk::Transform<double, 3, 3>;
using Affine = itk::AffineTransform<double, 3>;

/// ITK's registry of transforms is global, and its HDF5 is not made for threads.
std::unique_lock<std::mutex> lock_itk_transforms() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  static std::once_flag registered;
  std::call_once(registered, [] { itk::TransformFactoryBase::RegisterDefaultTransforms(); });
  return lock;
}

/// Chosen by hand: no factory of file formats has to be registered, and none of another library
/// interferes.
itk::TransformIOBaseTemplate<double>::Pointer transform_io(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".tfm" || extension == ".txt")
    return itk::TxtTransformIOTemplate<double>::New().GetPointer();
  if (extension == ".h5" || extension == ".hdf5")
    return itk::HDF5TransformIOTemplate<double>::New().GetPointer();
  throw InputError(path.string(), "extension is '" + extension +
                                      "', must be .tfm, .txt, .h5 or .hdf5 (ITK transform)");
}

/// The part of ITK's message that is about the file, not about ITK's source code.
std::string description(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  const std::size_t prefix = text.find("): ");
  if (prefix != std::string::npos) text = text.substr(prefix + 3);
  return text.substr(0, text.find_first_of("\r\n"));
}

void read(itk::TransformFileReaderTemplate<double>& reader, const std::string& source) {
  const std::string violation = "is not an ITK transform file: ";
  try {
    reader.Update();
  } catch (const itk::ExceptionObject& error) {
    throw InputError(source, violation + description(error));
  } catch (const std::exception& error) {
    throw InputError(source, violation + error.what());
  } catch (...) {  // HDF5 throws a type of its own
    throw InputError(source, violation + "HDF5 cannot read it");
  }
}

}  // namespace

LinearMap read_itk_transform(const std::filesystem::path& path) {
  const std::string source = path.string();
  const auto io = transform_io(path);
  read_prefix(path, 1);  // clear words for what is missing, empty or a folder
  const auto lock = lock_itk_transforms();
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetTransformIO(io);
  reader->SetFileName(source);
  read(*reader, source);
  const auto* transforms = reader->GetTransformList();
  if (transforms->size() != 1)
    throw InputError(source, "holds " + std::to_string(transforms->size()) +
                                 " transforms, must hold 1 (or one CompositeTransform)");
  LinearMap map;
  map.type = transforms->front()->GetTransformTypeAsString();
  const auto* transform = dynamic_cast<const AnyTransform*>(transforms->front().GetPointer());
  if (transform == nullptr || !transform->IsLinear())
    throw InputError(source,
                     "holds a " + map.type + ", must be a linear transform from 3 to 3 dimensions");
  // What it does to four points is all there is to a linear transform, of whatever class.
  const AnyTransform::InputPointType origin(0.0);
  const AnyTransform::OutputPointType moved = transform->TransformPoint(origin);
  for (unsigned row = 0; row < 3; ++row) map.translation[row] = moved[row];
  for (unsigned axis = 0; axis < 3; ++axis) {
    AnyTransform::InputPointType unit(0.0);
    unit[axis] = 1.0;
    const auto column = transform->TransformPoint(unit) - moved;
    for (unsigned row = 0; row < 3; ++row) map.matrix[row][axis] = column[row];
  }
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
