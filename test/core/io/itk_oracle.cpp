#include "core/io/itk_oracle.h"

#include <itkCompositeTransform.h>
#include <itkHDF5TransformIO.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkTransformFactory.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>
#include <itkTxtTransformIO.h>
#include <itk_H5Cpp.h>

#include <algorithm>
#include <stdexcept>

namespace usct::test {
namespace {

itk::ImageIOBase::Pointer image_io(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".nrrd" || extension == ".nhdr") return itk::NrrdImageIO::New().GetPointer();
  if (extension == ".mha" || extension == ".mhd") return itk::MetaImageIO::New().GetPointer();
  return itk::NiftiImageIO::New().GetPointer();
}

void set_whole_region(itk::ImageIOBase& io) {
  itk::ImageIORegion region(3);
  for (unsigned axis = 0; axis < 3; ++axis) region.SetSize(axis, io.GetDimensions(axis));
  io.SetIORegion(region);
}

using AnyTransform = itk::Transform<double, 3, 3>;

itk::TransformIOBaseTemplate<double>::Pointer transform_io(const std::filesystem::path& path) {
  itk::TransformFactoryBase::RegisterDefaultTransforms();
  if (path.extension() == ".h5") return itk::HDF5TransformIO::New().GetPointer();
  return itk::TxtTransformIO::New().GetPointer();
}

template <typename Parameters>
Parameters as_parameters(const std::vector<double>& values) {
  Parameters parameters(values.size());
  std::copy(values.begin(), values.end(), parameters.begin());
  return parameters;
}

AnyTransform::Pointer made_of(const ItkTransform& part) {
  const auto object = itk::ObjectFactoryBase::CreateInstance(part.type.c_str());
  AnyTransform::Pointer transform = dynamic_cast<AnyTransform*>(object.GetPointer());
  if (!transform) throw std::runtime_error("no transform " + part.type);
  transform->UnRegister();  // CreateInstance counts a reference too many
  transform->SetFixedParameters(
      as_parameters<AnyTransform::FixedParametersType>(part.fixed_parameters));
  transform->SetParameters(as_parameters<AnyTransform::ParametersType>(part.parameters));
  return transform;
}

void add_numbers(const H5::Group& group, const char* name, const std::vector<double>& values) {
  const hsize_t count = values.size();
  group.createDataSet(name, H5::PredType::NATIVE_DOUBLE, H5::DataSpace(1, &count))
      .write(values.data(), H5::PredType::NATIVE_DOUBLE);
}

}  // namespace

ItkImage read_by_itk(const std::filesystem::path& path) {
  const itk::ImageIOBase::Pointer io = image_io(path);
  io->SetFileName(path.string());
  io->ReadImageInformation();
  if (io->GetNumberOfDimensions() != 3 || io->GetComponentType() != itk::IOComponentEnum::SHORT)
    throw std::runtime_error("not a volume of 16-bit voxels");
  ItkImage image;
  for (unsigned axis = 0; axis < 3; ++axis) {
    image.size.push_back(static_cast<int>(io->GetDimensions(axis)));
    image.spacing.push_back(io->GetSpacing(axis));
    image.origin.push_back(io->GetOrigin(axis));
    for (const double cosine : io->GetDirection(axis)) image.direction.push_back(cosine);
  }
  set_whole_region(*io);
  image.voxels.resize(io->GetImageSizeInPixels());
  io->Read(image.voxels.data());
  return image;
}

void write_by_itk(const ItkImage& image, const std::filesystem::path& path, bool compressed) {
  const itk::ImageIOBase::Pointer io = image_io(path);
  io->SetFileName(path.string());
  io->SetNumberOfDimensions(3);
  for (unsigned axis = 0; axis < 3; ++axis) {
    io->SetDimensions(axis, static_cast<itk::SizeValueType>(image.size[axis]));
    io->SetSpacing(axis, image.spacing[axis]);
    io->SetOrigin(axis, image.origin[axis]);
    const double* direction = &image.direction[3 * axis];
    io->SetDirection(axis, std::vector<double>(direction, direction + 3));
  }
  set_whole_region(*io);
  io->SetPixelType(itk::IOPixelEnum::SCALAR);
  io->SetNumberOfComponents(1);
  io->SetComponentType(itk::IOComponentEnum::SHORT);
  io->SetUseCompression(compressed);
  io->Write(image.voxels.data());
}

void write_by_itk(const std::vector<ItkTransform>& parts, const std::filesystem::path& path) {
  const auto writer = itk::TransformFileWriterTemplate<double>::New();
  writer->SetTransformIO(transform_io(path));
  writer->SetFileName(path.string());
  const auto composite = itk::CompositeTransform<double, 3>::New();
  for (const ItkTransform& part : parts) composite->AddTransform(made_of(part));
  if (parts.size() == 1)
    writer->SetInput(composite->GetNthTransform(0));
  else
    writer->SetInput(composite);
  writer->Update();
}

std::array<double, 3> moved_by_itk(const std::filesystem::path& path,
                                   const std::array<double, 3>& point) {
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetTransformIO(transform_io(path));
  reader->SetFileName(path.string());
  reader->Update();
  const auto* transform =
      dynamic_cast<const AnyTransform*>(reader->GetTransformList()->front().GetPointer());
  const AnyTransform::OutputPointType moved = transform->TransformPoint(point.data());
  return {moved[0], moved[1], moved[2]};
}

void write_hdf5_transform(const ItkTransform& transform, bool with_fixed_parameters,
                          const std::filesystem::path& path) {
  const H5::H5File file(path.string(), H5F_ACC_TRUNC);
  const H5::Group group = file.createGroup("TransformGroup").createGroup("0");
  const hsize_t one = 1;
  const H5::StrType type(H5::PredType::C_S1, H5T_VARIABLE);
  const char* name = transform.type.c_str();
  group.createDataSet("TransformType", type, H5::DataSpace(1, &one)).write(&name, type);
  add_numbers(group, "TransformParameters", transform.parameters);
  if (with_fixed_parameters)
    add_numbers(group, "TransformFixedParameters", transform.fixed_parameters);
}

}  // namespace usct::test
