#include "us_ct_registration/io/file_kind.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

constexpr std::size_t kDicomPreamble = 128;

/// The first bytes of a file, up to the end of DICOM's magic.
std::string first_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(kDicomPreamble + 4, '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) && !file.eof())
    throw InputError(path.string(), std::string("cannot be read: ") + std::strerror(errno));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

std::string file_kind_name(FileKind kind) {
  switch (kind) {
    case FileKind::kDicom:
      return "DICOM series";
    case FileKind::kVolume:
      return "volume";
    case FileKind::kPreScan:
      return "pre-scan ultrasound (NRRD)";
    case FileKind::kIgsio:
      return "tracked ultrasound sequence (IGSIO)";
    case FileKind::kUltrasonix:
      return "Ultrasonix recording";
    case FileKind::kPropello:
      return "Propello volumes";
    case FileKind::kTransform:
      return "ITK transform";
    case FileKind::kResult:
      return "registration result";
    case FileKind::kPoints:
      return "points (CSV)";
    case FileKind::kProbe:
      return "probe configuration";
  }
  return "unknown";
}

FileKind detect_file_kind(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw InputError(path.string(), "does not exist");
  if (std::filesystem::is_directory(status)) return FileKind::kDicom;
  const std::string bytes = first_bytes(path);
  if (bytes.empty()) throw InputError(path.string(), "is empty");
  if (bytes.size() == kDicomPreamble + 4 && bytes.substr(kDicomPreamble) == "DICM")
    return FileKind::kDicom;
  if (is_prescan_nrrd(path)) return FileKind::kPreScan;
  if (is_igsio(path)) return FileKind::kIgsio;
  if (has_volume_extension(path)) return FileKind::kVolume;

  const std::string extension = lower_extension(path);
  const auto any_of = [&](std::initializer_list<const char*> extensions) {
    return std::any_of(extensions.begin(), extensions.end(),
                       [&](const char* e) { return extension == e; });
  };
  if (any_of({".tfm", ".txt", ".h5", ".hdf5", ".mat"})) return FileKind::kTransform;
  if (any_of({".json"})) return FileKind::kResult;
  if (any_of({".csv"})) return FileKind::kPoints;
  if (any_of({".yaml", ".yml"})) return FileKind::kProbe;
  // The extension speaks before the content: a damaged recording is a damaged recording.
  if (any_of({".vol"}) || is_propello(path)) return FileKind::kPropello;
  if (any_of({".bpr", ".b8", ".b32", ".rf", ".mpr", ".m"}) || is_ultrasonix(path))
    return FileKind::kUltrasonix;
  throw InputError(path.string(),
                   "is none of the files that are read: DICOM, NRRD, MetaImage, NIfTI, IGSIO "
                   "sequence, Ultrasonix .bpr, Propello .vol, ITK transform, result JSON, points "
                   "CSV, probe YAML");
}

}  // namespace usct
