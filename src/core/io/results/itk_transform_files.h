#pragma once

#include <itkCompositeTransform.h>
#include <itkMatrixOffsetTransformBase.h>
#include <itkTransformFactory.h>

#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "io/results/itk_transform.h"
#include "text.h"
#include "us_ct_registration/error.h"

/// The modules for ITK's two kinds of transform files share these functions. The modules read and
/// write the files themselves, and leave to ITK what the parameters of its transforms mean: its own
/// readers take missing parameters from beyond the end of those that are there, and its writers
/// leave a torn file, or crash, where the disk is full.
namespace usct::io {

using AnyTransform = itk::Transform<double, 3, 3>;

inline const std::string kNoTransformFile = "is not an ITK transform file: ";

/// The type that we write, in double precision.
inline constexpr const char* kWrittenType = "AffineTransform_double_3_3";

/// A transform as a file states it.
struct StoredTransform {
  std::string type;
  std::optional<std::vector<double>> parameters;
  std::optional<std::vector<double>> fixed_parameters;
};

/// Locks ITK's registry of transforms, which is global, and HDF5, which is not safe for threads.
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

/// A composite holds the transforms that follow it in the file, and no parameters.
inline bool is_composite(const std::string& type) {
  return type.rfind("CompositeTransform", 0) == 0;
}

/// A new transform of this type, always in double precision. Throws InputError unless it is linear,
/// from 3 to 3 dimensions, and of one part.
inline AnyTransform::Pointer new_transform(const std::string& type, const std::string& source) {
  const std::string kSingle = "_float_";
  std::string name = type;
  if (const std::size_t at = name.find(kSingle); at != std::string::npos)
    name.replace(at, kSingle.size(), "_double_");
  const itk::LightObject::Pointer object = itk::ObjectFactoryBase::CreateInstance(name.c_str());
  if (object) object->UnRegister();  // CreateInstance counts a reference too many
  AnyTransform::Pointer transform = dynamic_cast<AnyTransform*>(object.GetPointer());
  if (!transform || !transform->IsLinear() || is_composite(type))
    throw InputError(source, "holds a " + in_quotes(type) +
                                 ", must be a linear transform from 3 to 3 dimensions");
  return transform;
}

/// Throws InputError unless the transform is given just the finite numbers that it needs.
inline void require_parameters(const StoredTransform& stored, const AnyTransform& transform,
                               const std::string& source) {
  const std::string of_type = " of a " + stored.type;
  const auto require_count = [&](const std::vector<double>& values, const std::string& name,
                                 std::size_t count) {
    if (values.size() != count)
      throw InputError(source, name + of_type + " are " + std::to_string(values.size()) +
                                   " numbers, must be " + std::to_string(count));
    for (const double value : values)
      if (!std::isfinite(value)) throw InputError(source, name + of_type + " are not all finite");
  };
  if (!stored.parameters || !stored.fixed_parameters)
    throw InputError(source, "'Parameters' or 'FixedParameters'" + of_type + " are missing");
  require_count(*stored.parameters, "'Parameters'", transform.GetNumberOfParameters());
  // Older files lack the order of the angles after the centre.
  const std::size_t fixed = transform.GetFixedParameters().Size();
  const bool without_order =
      stored.type.rfind("Euler3DTransform", 0) == 0 && stored.fixed_parameters->size() == fixed - 1;
  require_count(*stored.fixed_parameters, "'FixedParameters'", without_order ? fixed - 1 : fixed);
  // The vector part of a unit quaternion, which ITK would cut down to a half turn.
  constexpr double kMostVersor = 1.0 + 1e-6;
  const bool is_versor =
      stored.type.find("Versor") != std::string::npos || stored.type.rfind("Similarity3D", 0) == 0;
  const std::vector<double>& values = *stored.parameters;
  if (is_versor && std::hypot(values[0], values[1], values[2]) > kMostVersor)
    throw InputError(source, "'Parameters'" + of_type +
                                 " begin with a versor longer than 1, which is no rotation");
}

inline AnyTransform::Pointer made_of(const StoredTransform& stored, const std::string& source) {
  const AnyTransform::Pointer transform = new_transform(stored.type, source);
  require_parameters(stored, *transform, source);
  const std::vector<double>& fixed = *stored.fixed_parameters;
  const std::vector<double>& values = *stored.parameters;
  AnyTransform::FixedParametersType fixed_parameters(fixed.size());
  std::copy(fixed.begin(), fixed.end(), fixed_parameters.begin());
  AnyTransform::ParametersType parameters(values.size());
  std::copy(values.begin(), values.end(), parameters.begin());
  transform->SetFixedParameters(fixed_parameters);
  transform->SetParameters(parameters);
  // The parameters of a VersorTransform make its matrix alone, without the offset that follows from
  // the centre.
  if (auto* centred =
          dynamic_cast<itk::MatrixOffsetTransformBase<double, 3, 3>*>(transform.GetPointer()))
    centred->SetCenter(centred->GetCenter());
  return transform;
}

/// The map of a file's transforms. Throws InputError unless they are one linear transform, or a
/// composite of such, with all their parameters.
inline LinearMap linear_map(const std::vector<StoredTransform>& stored, const std::string& source) {
  const bool composite = !stored.empty() && is_composite(stored.front().type);
  const std::size_t first = composite ? 1 : 0;
  if (stored.size() == first) throw InputError(source, kNoTransformFile + "it has no transform");
  if (!composite && stored.size() > 1)
    throw InputError(source, "holds " + std::to_string(stored.size()) +
                                 " transforms, must hold 1 (or one CompositeTransform)");
  const auto whole = itk::CompositeTransform<double, 3>::New();  // applies its last part first
  for (std::size_t i = first; i < stored.size(); ++i)
    whole->AddTransform(made_of(stored[i], source));
  LinearMap map;
  map.type = stored.front().type;
  const AnyTransform::OutputPointType moved =
      whole->TransformPoint(AnyTransform::InputPointType(0.0));
  for (unsigned row = 0; row < 3; ++row) map.translation[row] = moved[row];
  for (unsigned axis = 0; axis < 3; ++axis) {
    AnyTransform::InputVectorType unit(0.0);
    unit[axis] = 1.0;
    const AnyTransform::OutputVectorType column = whole->TransformVector(unit);
    for (unsigned row = 0; row < 3; ++row) map.matrix[row][axis] = column[row];
  }
  return map;
}

/// The parameters of an affine transform: the matrix row by row, and the translation.
inline std::vector<double> written_parameters(const LinearMap& map) {
  std::vector<double> parameters;
  for (const auto& row : map.matrix) parameters.insert(parameters.end(), row.begin(), row.end());
  parameters.insert(parameters.end(), map.translation.begin(), map.translation.end());
  for (double& value : parameters) value += 0.0;  // no negative zeros
  return parameters;
}

/// Its fixed parameters: the centre.
inline const std::vector<double> kWrittenCentre = {0.0, 0.0, 0.0};

}  // namespace usct::io
