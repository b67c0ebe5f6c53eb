#pragma once

#include <itkAffineTransform.h>
#include <itkCompositeTransform.h>
#include <itkTransformFactory.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>

#include <mutex>
#include <string>

#include "io/results/itk_transform.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

/// What the modules for ITK's two kinds of transform files share. Each brings its reader and writer
/// itself, so that no factory has to be registered and those of other libraries cannot interfere.
namespace usct::io {

using AnyTransform = itk::Transform<double, 3, 3>;
using TransformIo = itk::TransformIOBaseTemplate<double>::Pointer;

inline const std::string kNoTransformFile = "is not an ITK transform file: ";

/// Locks ITK's transform files. Its registry of transforms is global, and its HDF5 library is not
/// safe for threads.
inline std::unique_lock<std::mutex> lock_itk_transforms() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  static std::once_flag registered;
  std::call_once(registered, [] {
    itk::TransformFactoryBase::RegisterDefaultTransforms();
    // Older versions of ANTs write this transform, which is not among the defaults.
    itk::TransformFactory<itk::MatrixOffsetTransformBase<double, 3, 3>>::RegisterTransform();
  });
  return lock;
}

/// The part of ITK's message that is about the file, not about ITK's source code.
inline std::string description(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  const std::size_t prefix = text.find("): ");
  if (prefix != std::string::npos) text = text.substr(prefix + 3);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// Runs `action` and turns exceptions of ITK into InputErrors.
template <typename Action>
void with_input_errors(const std::string& source, const Action& action) {
  try {
    action();
  } catch (const itk::ExceptionObject& error) {
    throw InputError(source, kNoTransformFile + description(error));
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {  // ITK throws this for some unknown names of transforms
    throw InputError(source, kNoTransformFile + error.what());
  }
}

inline LinearMap linear_map(const AnyTransform& transform) {
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

/// Restores the offset that ITK leaves out when it reads some transforms with a centre: the
/// parameters of a VersorTransform make its matrix alone.
inline void apply_centre(itk::TransformBaseTemplate<double>& transform) {
  if (auto* composite = dynamic_cast<itk::CompositeTransform<double, 3>*>(&transform)) {
    for (itk::SizeValueType i = 0; i < composite->GetNumberOfTransforms(); ++i)
      apply_centre(*composite->GetNthTransformModifiablePointer(i));
  } else if (dynamic_cast<itk::MatrixOffsetTransformBase<double, 3, 3>*>(&transform) != nullptr) {
    transform.SetFixedParameters(transform.GetFixedParameters());
  }
}

/// Reads a file of which the reader's own faults are ruled out.
inline LinearMap read_by(const TransformIo& io, const std::filesystem::path& path) {
  const std::string source = path.string();
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetTransformIO(io);
  reader->SetFileName(source);
  with_input_errors(source, [&] { reader->Update(); });
  const auto* transforms = reader->GetTransformList();
  if (transforms->size() != 1)
    throw InputError(source, "holds " + std::to_string(transforms->size()) +
                                 " transforms, must hold 1 (or one CompositeTransform)");
  apply_centre(*transforms->front());
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

inline void write_by(const TransformIo& io, const LinearMap& map,
                     const std::filesystem::path& path) {
  const auto affine = itk::AffineTransform<double, 3>::New();
  itk::AffineTransform<double, 3>::MatrixType matrix;
  itk::AffineTransform<double, 3>::OutputVectorType translation;
  for (unsigned row = 0; row < 3; ++row) {
    for (unsigned column = 0; column < 3; ++column) matrix(row, column) = map.matrix[row][column];
    translation[row] = map.translation[row];
  }
  affine->SetMatrix(matrix);
  affine->SetTranslation(translation);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    writer->SetTransformIO(io);
    writer->SetFileName(temporary.string());
    writer->SetInput(affine);
    writer->Update();
  });
}

}  // namespace usct::io
