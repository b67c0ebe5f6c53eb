#include "us_ct_registration/io/transform_io.h"

#include <itkAffineTransform.h>
#include <itkHDF5TransformIO.h>
#include <itkTransformFactoryBase.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>

#include <mutex>

#include "io/bytes.h"
#include "io/rigid.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
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

/// The map of any linear transform, from what it does to points.
Eigen::Isometry3d linear_map(const AnyTransform& transform, const std::string& source) {
  const auto apply = [&](const Eigen::Vector3d& p) {
    const auto q = transform.TransformPoint(itk::Point<double, 3>(p.data()));
    return Eigen::Vector3d(q[0], q[1], q[2]);
  };
  const Eigen::Vector3d origin = apply(Eigen::Vector3d::Zero());
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int axis = 0; axis < 3; ++axis)
    T.linear().col(axis) = apply(Eigen::Vector3d::Unit(axis)) - origin;
  T.translation() = origin;
  io::require_rotation(T.linear(), source, transform.GetTransformTypeAsString());
  if (!origin.allFinite()) throw InputError(source, "translation is not finite");
  return T;
}

/// The part of ITK's message that is about the file, not about ITK's source code.
std::string description(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  const std::size_t prefix = text.find("): ");
  if (prefix != std::string::npos) text = text.substr(prefix + 3);
  return text.substr(0, text.find_first_of("\r\n"));
}

}  // namespace

Eigen::Isometry3d read_T_us_ct(const std::filesystem::path& path) {
  const std::string source = path.string();
  const auto io = transform_io(path);
  io::read_prefix(path, 1);  // clear words for what is missing, empty or a folder
  const auto lock = lock_itk_transforms();
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetTransformIO(io);
  reader->SetFileName(source);
  try {
    reader->Update();
  } catch (const itk::ExceptionObject& error) {
    throw InputError(source, "is not an ITK transform file: " + description(error));
  } catch (const std::exception& error) {
    throw InputError(source, std::string("is not an ITK transform file: ") + error.what());
  } catch (...) {  // HDF5 throws a type of its own
    throw InputError(source, "is not an ITK transform file: HDF5 cannot read it");
  }
  const auto* transforms = reader->GetTransformList();
  if (transforms->size() != 1)
    throw InputError(source, "holds " + std::to_string(transforms->size()) +
                                 " transforms, must hold 1 (or one CompositeTransform)");
  const auto* transform = dynamic_cast<const AnyTransform*>(transforms->front().GetPointer());
  if (transform == nullptr)
    throw InputError(source, "holds a " + transforms->front()->GetTransformTypeAsString() +
                                 ", must be a transform from 3 to 3 dimensions");
  if (!transform->IsLinear())
    throw InputError(source, "holds a " + transform->GetTransformTypeAsString() +
                                 ", must be linear (a rotation and a translation)");
  return linear_map(*transform, source).inverse();
}

void write_T_us_ct(const Eigen::Isometry3d& T_us_ct, const std::filesystem::path& path) {
  io::require_rotation(T_us_ct.linear(), path.string(), "T_us_ct");
  if (!T_us_ct.matrix().allFinite()) throw InputError(path.string(), "'T_us_ct' is not finite");
  const Eigen::Isometry3d T_ct_us = T_us_ct.inverse();
  const auto affine = Affine::New();
  Affine::MatrixType matrix;
  Affine::OutputVectorType translation;
  for (unsigned row = 0; row < 3; ++row) {
    for (unsigned column = 0; column < 3; ++column)
      matrix(row, column) = T_ct_us.linear()(row, column);
    translation[row] = T_ct_us.translation()[row];
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

}  // namespace usct
