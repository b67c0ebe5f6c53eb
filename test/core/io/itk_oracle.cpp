#include "core/io/itk_oracle.h"

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

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

}  // namespace usct::test
