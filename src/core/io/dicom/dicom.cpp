#include "us_ct_registration/io/dicom/dicom.h"

#include <algorithm>
#include <string_view>

#include "io/bytes.h"
#include "io/dicom/dicom_report.h"
#include "io/dicom/dicom_series.h"
#include "io/format.h"
#include "parallel.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using io::DicomFile;
using io::Series;
using io::Slice;
using io::SliceStack;

/// Throws InputError, before any pixel is read, for slices that cannot become a volume.
void check_stack(const std::string& source, const SliceStack& stacked,
                 const DicomReadOptions& options, std::vector<std::string>& warnings) {
  if (!stacked.fatal.empty()) throw InputError(source, stacked.fatal.front());
  for (const std::string& irregular : stacked.irregular)
    warnings.push_back("resampled onto a regular grid: " + irregular);
  if (stacked.irregular.empty() || options.resample_irregular) return;
  std::string all;
  for (const std::string& irregular : stacked.irregular)
    all += (all.empty() ? "" : "; and ") + irregular;
  throw InputError(source, all +
                               ". The slices must form a regular grid; 'resample_irregular' "
                               "interpolates them onto one");
}

/// The voxels of the slices in the stack's order. Throws InputError if slices at one place differ.
std::vector<std::int16_t> load_voxels(const std::string& source, const std::vector<Slice>& slices,
                                      const SliceStack& stacked, const Progress& progress) {
  const auto slice = [&](int i) -> const Slice& { return slices[static_cast<std::size_t>(i)]; };
  const auto pixels_of = [&](int i) {
    return io::read_dicom_hounsfield(*slice(i).file, slice(i).frame);
  };
  // A header may claim any size. Memory for all slices is allocated only after the pixels of one
  // slice were read.
  const std::size_t count = pixels_of(stacked.order.front()).size();
  std::vector<std::int16_t> voxels(count * stacked.order.size());
  const auto load = [&](int place) {
    const auto k = static_cast<std::size_t>(place);
    const std::vector<std::int16_t> pixels = pixels_of(stacked.order[k]);
    std::copy(pixels.begin(), pixels.end(), &voxels[k * count]);
    for (const int i : stacked.duplicates[k])
      if (pixels_of(i) != pixels)
        throw InputError(source,
                         io::different_pixels(slice(stacked.order[k]).info(), slice(i).info()));
  };
  parallel_for(static_cast<int>(stacked.order.size()), load, progress);
  return voxels;
}

void check_files(const Series& series) {
  for (const DicomFile* file : series.images)
    if (!file->problem.empty()) throw InputError(file->path.string(), file->problem);
}

std::vector<Slice> require_slices(const std::string& source, const Series& series,
                                  const DicomReadOptions& options) {
  check_files(series);
  std::vector<Slice> slices = io::slices_of(series, options);
  if (slices.empty())
    throw InputError(source, options.acquisition_number
                                 ? "'acquisition_number' is " +
                                       std::to_string(*options.acquisition_number) +
                                       ", must be that of slices of the series"
                                 : "the series holds localizers only, must hold slices");
  return slices;
}

CtVolume load_volume(const std::string& source, const std::vector<Slice>& slices,
                     const SliceStack& stacked, const Progress& progress) {
  std::vector<std::int16_t> voxels = load_voxels(source, slices, stacked, progress);
  if (!stacked.irregular.empty())
    return io::resample_stack(source, io::poses_of(slices), stacked, voxels);
  CtVolume volume;
  volume.grid = stacked.grid;
  volume.voxels = std::move(voxels);
  return volume;
}

}  // namespace

void DicomReadOptions::validate() const {
  if (!(position_tolerance > 0.0 && position_tolerance <= 0.5))
    throw InputError(
        "DicomReadOptions",
        "'position_tolerance' is " + io::format(position_tolerance) + ", must be > 0 and <= 0.5");
}

std::vector<DicomSeries> find_dicom_series(const fs::path& path) {
  const io::DicomScan scan = io::scan_dicom(path);
  std::vector<DicomSeries> found;
  for (const Series& series : io::group_by_series(scan)) found.push_back(io::summarise(series));
  return found;
}

LoadedCt read_dicom_ct(const fs::path& path, const DicomReadOptions& options,
                       const Progress& progress, const CtSelection& selection) {
  options.validate();
  const std::string source = path.string();
  const io::DicomScan scan = io::scan_dicom(path);
  const std::vector<Series> all = io::group_by_series(scan);
  const Series& series = io::choose_series(path, all, options);
  const std::vector<Slice> slices = require_slices(source, series, options);

  LoadedCt ct;
  ct.format = "DICOM";
  ct.series_uid = series.first().series_uid;
  ct.frame_of_reference_uid = series.first().frame_of_reference_uid;
  ct.warnings = io::warnings_of(scan, all, series, slices);
  const SliceStack stacked = io::stack_of(slices, options.position_tolerance);
  check_stack(source, stacked, options, ct.warnings);
  ct.whole_grid = stacked.irregular.empty()
                      ? stacked.grid
                      : io::resampled_grid(source, io::poses_of(slices), stacked);
  ct.whole_grid.validate(source);
  require_fits(selection, ct.whole_grid, sizeof(std::int16_t), source);
  ct.volume = load_volume(source, slices, stacked, progress);
  const std::vector<std::string> duplicates = io::for_each_duplicate(
      slices, stacked, [](const std::string& kept, const std::string& other) {
        return "passed over: '" + other + "', the same slice as '" + kept + "'";
      });
  ct.warnings.insert(ct.warnings.end(), duplicates.begin(), duplicates.end());
  ct.volume = selected(std::move(ct.volume), selection, ct.warnings);
  return ct;
}

bool is_dicom(const fs::path& path) {
  constexpr std::size_t kPreambleBytes = 128;
  constexpr std::string_view kMagic = "DICM";
  std::error_code error;
  if (fs::is_directory(path, error)) return true;
  try {
    const io::Bytes begin = io::read_prefix(path, kPreambleBytes + kMagic.size());
    const bool has_magic = begin.size() == kPreambleBytes + kMagic.size() &&
                           std::equal(kMagic.begin(), kMagic.end(), begin.begin() + kPreambleBytes);
    return has_magic || io::read_dicom_header(path).has_value();
  } catch (const InputError&) {
    return false;
  }
}

void require_no_choice(const DicomReadOptions& options, const std::string& source) {
  if (!options.series_uid.empty() || options.acquisition_number)
    throw InputError(
        source, "holds one volume, but a series or an acquisition is chosen, which is for DICOM");
}

LoadedCt read_ct(const fs::path& path, const DicomReadOptions& options, const Progress& progress,
                 const CtSelection& selection) {
  std::error_code error;
  if (!has_volume_extension(path) || fs::is_directory(path, error))
    return read_dicom_ct(path, options, progress, selection);
  require_no_choice(options, path.string());
  LoadedCt ct;
  const VolumeInfo info = read_volume_info(path);
  ct.format = info.format;
  ct.warnings = info.warnings;
  ct.whole_grid = info.grid;
  require_fits(selection, info.grid, info.voxel_bytes, path.string());
  ct.volume = selected(read_volume<std::int16_t>(path), selection, ct.warnings);
  return ct;
}

}  // namespace usct
