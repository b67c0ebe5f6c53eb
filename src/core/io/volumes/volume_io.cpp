#include "us_ct_registration/io/volumes/volume_io.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "io/bytes.h"
#include "io/compression.h"
#include "io/format.h"
#include "io/volumes/volume_header.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using io::Bytes;
using io::Component;
using io::Encoding;
using io::VolumeHeader;

enum class Format { kUnknown, kNrrd, kMetaImage, kNifti };

/// Whether the file name has this ending; the case of letters does not matter.
bool has_ending(const fs::path& path, const std::string& ending) {
  const std::string name = path.filename().string();
  return name.size() > ending.size() &&
         std::equal(ending.rbegin(), ending.rend(), name.rbegin(),
                    [](char a, unsigned char b) { return a == std::tolower(b); });
}

Format format_of(const fs::path& path) {
  if (has_ending(path, ".nrrd") || has_ending(path, ".nhdr")) return Format::kNrrd;
  if (has_ending(path, ".mha") || has_ending(path, ".mhd")) return Format::kMetaImage;
  if (has_ending(path, ".nii") || has_ending(path, ".nii.gz")) return Format::kNifti;
  return Format::kUnknown;
}

[[noreturn]] void refuse_extension(const fs::path& path) {
  throw InputError(path.string(),
                   "extension is '" + path.extension().string() +
                       "', must be .nrrd, .nhdr, .mha, .mhd, .nii or .nii.gz for a volume");
}

/// Throws InputError for ultrasound before scan conversion or of a tracked probe, which has the
/// endings of volumes: its frames would be taken for the slices of a CT, or its grey values for
/// labels.
void refuse_ultrasound(const fs::path& path) {
  if (is_igsio(path) || is_prescan_nrrd(path))
    throw InputError(path.string(), "is an ultrasound sequence, must be a volume");
}

VolumeHeader read_header(const fs::path& path) {
  refuse_ultrasound(path);
  switch (format_of(path)) {
    case Format::kNrrd:
      return io::read_nrrd_header(path);
    case Format::kMetaImage:
      return io::read_meta_header(path);
    case Format::kNifti:
      return io::read_nifti_header(path);
    case Format::kUnknown:
      break;
  }
  refuse_extension(path);
}

/// The voxels as stored, decompressed.
Bytes read_stored(const VolumeHeader& header) {
  const fs::path& source = header.data_file;
  if (header.encoding == Encoding::kRaw) {
    Bytes voxels(static_cast<std::size_t>(header.voxel_bytes()));
    io::read_bytes_into(source, header.begin + header.skip, voxels.data(), voxels.size());
    return voxels;
  }
  Bytes voxels = io::decompress(
      io::read_bytes(source), static_cast<std::size_t>(header.begin),
      header.skip + header.voxel_bytes(),
      header.encoding == Encoding::kGzip ? io::Compression::kGzip : io::Compression::kZlib,
      source.string());
  voxels.erase(voxels.begin(), voxels.begin() + static_cast<std::ptrdiff_t>(header.skip));
  return voxels;
}

void reverse_bytes(std::uint8_t* values, std::size_t count, std::size_t value_bytes) {
  for (std::size_t i = 0; i < count; ++i)
    std::reverse(values + i * value_bytes, values + (i + 1) * value_bytes);
}

/// Range and faults of the converted values.
struct ValueRange {
  double least = std::numeric_limits<double>::infinity();
  double greatest = -std::numeric_limits<double>::infinity();
  bool nan = false;
  bool fraction = false;
};

template <typename Stored, typename T>
ValueRange convert_from(const std::uint8_t* stored, const VolumeHeader& header,
                        std::vector<T>& voxels) {
  constexpr double kLowest = std::numeric_limits<T>::lowest();
  constexpr double kHighest = std::numeric_limits<T>::max();
  ValueRange range;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    Stored raw;
    std::memcpy(&raw, stored + i * sizeof(Stored), sizeof(Stored));
    const double value = static_cast<double>(raw) * header.scale + header.offset;
    range.least = std::min(range.least, value);  // NaN does not change the range
    range.greatest = std::max(range.greatest, value);
    if constexpr (std::is_integral_v<T>) {
      const double rounded = std::nearbyint(value);
      range.nan |= std::isnan(value);
      range.fraction |= rounded != value;
      voxels[i] = static_cast<T>(std::isnan(value) ? 0.0 : std::clamp(rounded, kLowest, kHighest));
    } else {
      voxels[i] =
          static_cast<T>(std::isfinite(value) ? std::clamp(value, kLowest, kHighest) : value);
    }
  }
  return range;
}

template <typename T>
ValueRange convert(const std::uint8_t* stored, const VolumeHeader& header, std::vector<T>& voxels) {
  switch (header.component) {
    case Component::kInt8:
      return convert_from<std::int8_t>(stored, header, voxels);
    case Component::kUint8:
      return convert_from<std::uint8_t>(stored, header, voxels);
    case Component::kInt16:
      return convert_from<std::int16_t>(stored, header, voxels);
    case Component::kUint16:
      return convert_from<std::uint16_t>(stored, header, voxels);
    case Component::kInt32:
      return convert_from<std::int32_t>(stored, header, voxels);
    case Component::kUint32:
      return convert_from<std::uint32_t>(stored, header, voxels);
    case Component::kInt64:
      return convert_from<std::int64_t>(stored, header, voxels);
    case Component::kUint64:
      return convert_from<std::uint64_t>(stored, header, voxels);
    case Component::kFloat32:
      return convert_from<float>(stored, header, voxels);
    case Component::kFloat64:
      return convert_from<double>(stored, header, voxels);
  }
  throw std::logic_error("component type without a conversion");
}

template <typename T>
Component component_of() {
  if constexpr (std::is_same_v<T, std::uint8_t>) return Component::kUint8;
  if constexpr (std::is_same_v<T, std::int16_t>) return Component::kInt16;
  if constexpr (std::is_same_v<T, std::uint16_t>) return Component::kUint16;
  if constexpr (std::is_same_v<T, float>) return Component::kFloat32;
}

/// A CT is the likely mistake where ultrasound or labels are asked for: only CTs have air.
std::string words_for_ct(const ValueRange& range) {
  constexpr double kAirHu = -900.0;
  return range.least <= kAirHu ? "; they look like the HU of a CT: are two files exchanged?" : "";
}

template <typename T>
void check_values(const fs::path& path, const ValueRange& range) {
  const auto refuse = [&](const std::string& violation) {
    throw InputError(path.string(), "voxel values " + violation + " (" +
                                        io::name_of(component_of<T>()) + " is asked for)" +
                                        (std::is_unsigned_v<T> ? words_for_ct(range) : ""));
  };
  const std::string found = "from " + io::format(range.least) + " to " + io::format(range.greatest);
  constexpr double kLowest = std::numeric_limits<T>::lowest();
  constexpr double kHighest = std::numeric_limits<T>::max();
  if constexpr (std::is_integral_v<T>) {
    if (range.nan) refuse("hold NaN, must be numbers");
    if (std::nearbyint(range.least) < kLowest || std::nearbyint(range.greatest) > kHighest)
      refuse("range " + found + ", must lie from " + io::format(kLowest) + " to " +
             io::format(kHighest));
    if (range.fraction && !std::is_same_v<T, std::int16_t>)
      refuse("range " + found + " with fractions, must be whole numbers");
  } else {
    const bool fits = (range.least >= kLowest || std::isinf(range.least)) &&
                      (range.greatest <= kHighest || std::isinf(range.greatest));
    if (!fits) refuse("range " + found + ", beyond what 32 bits hold");
  }
}

template <typename T>
Bytes joined(Bytes header, const std::vector<T>& voxels) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(voxels.data());
  header.insert(header.end(), data, data + voxels.size() * sizeof(T));
  return header;
}

template <typename T>
void write_nrrd(const Volume<T>& volume, const fs::path& path) {
  if (has_ending(path, ".nhdr"))
    throw InputError(path.string(), "extension is '.nhdr', must be .nrrd to write (one file)");
  io::write_bytes(path, joined(io::nrrd_header(volume.grid, component_of<T>()), volume.voxels));
}

/// Throws InputError if the file with the voxels exists and belongs to anything but the header that
/// is to be written: it may hold the voxels of the volume's own source.
void check_is_own(const fs::path& data_file, const fs::path& header) {
  if (!fs::exists(fs::symlink_status(data_file))) return;
  if (fs::is_regular_file(header)) {
    const VolumeHeader old = io::read_meta_header(header);
    if (fs::equivalent(old.data_file, data_file)) return;
  }
  throw InputError(data_file.string(), "exists, and is not the data file of '" + header.string() +
                                           "', which would replace it: choose another name");
}

template <typename T>
void write_meta(const Volume<T>& volume, const fs::path& named) {
  // The voxels stand beside the header, not beside a link to it.
  const fs::path path = behind_links(named);
  const bool two_files = has_ending(path, ".mhd");
  const fs::path data_file = fs::path(path).replace_extension(".raw");
  Bytes header = io::meta_header(path.string(), volume.grid, component_of<T>(),
                                 two_files ? data_file.filename().string() : "LOCAL");
  if (!two_files) return io::write_bytes(path, joined(std::move(header), volume.voxels));
  check_is_own(data_file, path);
  // A header never stands beside voxels that are not its own: the old one goes when the new voxels
  // are about to take their place, and the new one comes last.
  write_atomically(path, [&](const fs::path& new_header) {
    write_content(new_header, io::text_view(header), path);
    write_atomically(data_file, [&](const fs::path& new_data) {
      write_content(new_data, io::text_view(joined({}, volume.voxels)), data_file);
      fs::remove(path);
    });
  });
}

template <typename T>
void write_nifti(const Volume<T>& volume, const fs::path& path) {
  const Bytes bytes =
      joined(io::nifti_header(path.string(), volume.grid, component_of<T>()), volume.voxels);
  const bool gzip = has_ending(path, ".gz");
  io::write_bytes(path, gzip ? io::compress(bytes, io::Compression::kGzip) : bytes);
}

}  // namespace

bool has_volume_extension(const fs::path& path) { return format_of(path) != Format::kUnknown; }

VolumeInfo read_volume_info(const fs::path& path) {
  const VolumeHeader header = read_header(path);
  VolumeInfo info;
  info.format = header.format;
  info.grid = header.grid;
  info.component = io::name_of(header.component);
  info.voxel_bytes = io::bytes_of(header.component);
  info.compressed = header.encoding != Encoding::kRaw;
  info.scale = header.scale;
  info.offset = header.offset;
  info.warnings = header.warnings;
  return info;
}

template <typename T>
Volume<T> read_volume(const fs::path& path) {
  const VolumeHeader header = read_header(path);
  const bool as_asked =
      header.component == component_of<T>() && header.scale == 1.0 && header.offset == 0.0;
  if (as_asked && header.encoding == Encoding::kRaw && !header.big_endian) {
    Volume<T> volume(header.grid);  // no second copy of a large CT in the usual case
    io::read_bytes_into(header.data_file, header.begin + header.skip, volume.voxels.data(),
                        static_cast<std::size_t>(header.voxel_bytes()));
    return volume;
  }
  Bytes stored = read_stored(header);
  if (header.big_endian)
    reverse_bytes(stored.data(), header.grid.voxel_count(), io::bytes_of(header.component));
  Volume<T> volume(header.grid);
  if (as_asked)
    std::memcpy(volume.voxels.data(), stored.data(), stored.size());
  else
    check_values<T>(path, convert(stored.data(), header, volume.voxels));
  return volume;
}

template <typename T>
void write_volume(const Volume<T>& volume, const fs::path& path) {
  volume.grid.validate(path.string());
  if (volume.voxels.size() != volume.grid.voxel_count())
    throw InputError(path.string(), std::to_string(volume.voxels.size()) + " voxels, must be " +
                                        std::to_string(volume.grid.voxel_count()) +
                                        " as its grid says");
  switch (format_of(path)) {
    case Format::kNrrd:
      return write_nrrd(volume, path);
    case Format::kMetaImage:
      return write_meta(volume, path);
    case Format::kNifti:
      return write_nifti(volume, path);
    case Format::kUnknown:
      break;
  }
  refuse_extension(path);
}

template Volume<std::uint8_t> read_volume(const fs::path&);
template Volume<std::int16_t> read_volume(const fs::path&);
template Volume<std::uint16_t> read_volume(const fs::path&);
template Volume<float> read_volume(const fs::path&);
template void write_volume(const Volume<std::uint8_t>&, const fs::path&);
template void write_volume(const Volume<std::int16_t>&, const fs::path&);
template void write_volume(const Volume<std::uint16_t>&, const fs::path&);
template void write_volume(const Volume<float>&, const fs::path&);

}  // namespace usct
