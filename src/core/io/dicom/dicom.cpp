#include "us_ct_registration/io/dicom/dicom.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "io/dicom/dicom_file.h"
#include "io/dicom/slice_stack.h"
#include "io/format.h"
#include "parallel.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using io::DicomFile;
using io::DicomFrame;
using io::DicomKind;
using io::SliceStack;

/// How many of several files a message names.
constexpr std::size_t kNamed = 4;

struct Scan {
  /// By path.
  std::vector<DicomFile> files;
  std::vector<fs::path> not_dicom;
};

std::vector<fs::path> list_files(const fs::path& folder, bool with_subfolders) {
  std::vector<fs::path> paths;
  std::error_code error;
  const auto add = [&](const fs::directory_entry& entry) {
    std::error_code ignored;
    if (entry.is_regular_file(ignored)) paths.push_back(entry.path());
  };
  if (with_subfolders)
    for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
         it.increment(error))
      add(*it);
  else
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
      add(*it);
  if (error) throw InputError(folder.string(), "folder cannot be read: " + error.message());
  std::sort(paths.begin(), paths.end());
  return paths;
}

Scan scan_files(const std::vector<fs::path>& paths) {
  std::vector<std::optional<DicomFile>> read(paths.size());
  parallel_for(static_cast<int>(paths.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    read[at] = io::read_dicom_header(paths[at]);
  });
  Scan scan;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (!read[i])
      scan.not_dicom.push_back(paths[i]);
    else if (read[i]->kind != DicomKind::kDirectory)
      scan.files.push_back(std::move(*read[i]));
  }
  return scan;
}

Scan scan_folder(const fs::path& folder) {
  Scan scan = scan_files(list_files(folder, true));
  if (scan.files.empty())
    throw InputError(folder.string(), "folder holds no DICOM files (" +
                                          std::to_string(scan.not_dicom.size()) + " others)");
  return scan;
}

/// The files of one file's series, in its folder.
Scan scan_series_of(const fs::path& path) {
  const std::optional<DicomFile> file = io::read_dicom_header(path);
  if (!file) throw InputError(path.string(), "is not a DICOM file");
  if (file->kind == DicomKind::kDirectory)
    throw InputError(path.string(),
                     "is a DICOMDIR; must be the folder that it lies in, or an image");
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  Scan scan = scan_files(list_files(folder, false));
  const auto other = [&](const DicomFile& f) {
    return f.series_uid != file->series_uid || f.modality != file->modality;
  };
  scan.files.erase(std::remove_if(scan.files.begin(), scan.files.end(), other), scan.files.end());
  scan.not_dicom.clear();
  return scan;
}

Scan scan_path(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status))
    throw InputError(path.string(), status.type() == fs::file_type::not_found
                                        ? "does not exist"
                                        : "cannot be opened: " + error.message());
  return fs::is_directory(status) ? scan_folder(path) : scan_series_of(path);
}

/// The files of one series, and the frames in them that are slices.
struct Series {
  std::vector<const DicomFile*> images;
  std::vector<const DicomFile*> others;

  const DicomFile& first() const { return images.empty() ? *others.front() : *images.front(); }
  bool is_ct() const { return !images.empty(); }
};

/// By series number (unknown first), then UID.
std::vector<Series> group_by_series(const Scan& scan) {
  std::map<std::pair<std::string, std::string>, Series> by_uid;
  for (const DicomFile& file : scan.files) {
    Series& series = by_uid[{file.series_uid, file.modality}];
    (file.kind == DicomKind::kCtImage ? series.images : series.others).push_back(&file);
  }
  std::vector<Series> all;
  for (auto& entry : by_uid) all.push_back(std::move(entry.second));
  std::stable_sort(all.begin(), all.end(), [](const Series& a, const Series& b) {
    return a.first().series_number < b.first().series_number;
  });
  return all;
}

struct Slice {
  const DicomFile* file;
  std::size_t frame;

  const DicomFrame& info() const { return file->images.frames[frame]; }
};

std::vector<Slice> slices_of(const Series& series, const DicomReadOptions& options) {
  std::vector<Slice> slices;
  for (const DicomFile* file : series.images)
    for (std::size_t i = 0; i < file->images.frames.size(); ++i) {
      const Slice slice{file, i};
      if (slice.info().localizer) continue;
      if (options.acquisition_number &&
          slice.info().acquisition_number != options.acquisition_number)
        continue;
      slices.push_back(slice);
    }
  return slices;
}

SliceStack stack(const std::vector<Slice>& slices, double tolerance) {
  std::vector<io::SlicePose> poses;
  for (const Slice& slice : slices) poses.push_back(slice.info().pose);
  SliceStack result = io::stack_slices(poses, tolerance);
  for (const Slice& slice : slices)
    if (slice.file->frame_of_reference_uid != slices.front().file->frame_of_reference_uid) {
      result.fatal.push_back("slices differ in 'FrameOfReferenceUID': '" +
                             slices.front().info().pose.name + "' and '" + slice.info().pose.name +
                             "'");
      break;
    }
  return result;
}

std::string file_name(const DicomFile& file) { return file.path.filename().string(); }

/// "3 files that are ... (a, b, c)".
template <typename Item, typename Name>
std::string listed(const std::vector<Item>& items, const Name& name) {
  std::string out;
  for (std::size_t i = 0; i < std::min(items.size(), kNamed); ++i)
    out += (i > 0 ? ", " : "") + name(items[i]);
  return items.size() > kNamed ? out + ", ..." : out;
}

std::vector<std::string> problems_of(const Series& series, const std::vector<Slice>& slices,
                                     const SliceStack& stacked) {
  std::vector<std::string> problems;
  for (const DicomFile* file : series.images)
    if (!file->problem.empty()) problems.push_back(file_name(*file) + ": " + file->problem);
  if (!problems.empty()) return problems;
  problems = stacked.fatal;
  problems.insert(problems.end(), stacked.irregular.begin(), stacked.irregular.end());
  for (std::size_t k = 0; k < stacked.duplicates.size(); ++k)
    for (const int i : stacked.duplicates[k])
      problems.push_back("slices at one place: '" +
                         slices[static_cast<std::size_t>(stacked.order[k])].info().pose.name +
                         "' and '" + slices[static_cast<std::size_t>(i)].info().pose.name + "'");
  return problems;
}

DicomSeries describe(const Series& series) {
  DicomSeries out;
  const DicomFile& first = series.first();
  out.series_uid = first.series_uid;
  out.modality = first.modality;
  out.frame_of_reference_uid = first.frame_of_reference_uid;
  out.transfer_syntax_uid = first.transfer_syntax_uid;
  out.series_number = first.series_number;
  out.first_file = first.path;
  out.files = static_cast<int>(series.images.size() + series.others.size());
  out.is_ct = series.is_ct();
  if (!out.is_ct) return out;
  const DicomReadOptions defaults;
  const std::vector<Slice> slices = slices_of(series, defaults);
  const SliceStack stacked = stack(slices, defaults.position_tolerance);
  out.problems = problems_of(series, slices, stacked);
  out.slices = static_cast<int>(slices.size());
  if (slices.empty()) return out;
  const io::SlicePose& pose = slices.front().info().pose;
  out.columns = pose.size.x();
  out.rows = pose.size.y();
  out.axes = pose.axes;
  out.spacing_mm << pose.spacing_mm, stacked.spacing_mm;
  return out;
}

std::string uid_text(const std::string& uid) {
  return uid.empty() ? "(no SeriesInstanceUID)" : in_quotes(uid).substr(1, uid.size());
}

/// One line per series, for a message that asks for a choice.
std::string candidates(const std::vector<Series>& all) {
  std::string out;
  for (const Series& series : all) {
    const DicomSeries d = describe(series);
    out += "\n  " + uid_text(d.series_uid) + ": " + d.modality + ", ";
    if (d.series_number) out += "series number " + std::to_string(*d.series_number) + ", ";
    if (d.is_ct)
      out += std::to_string(d.slices) + " slices of " + std::to_string(d.columns) + " x " +
             std::to_string(d.rows) + ", spacing " + io::format(d.spacing_mm) + " mm";
    else
      out += std::to_string(d.files) + " files";
    if (!d.problems.empty()) out += " (" + d.problems.front() + ")";
  }
  return out;
}

const Series& select(const fs::path& path, const std::vector<Series>& all,
                     const DicomReadOptions& options) {
  std::vector<const Series*> matching;
  for (const Series& series : all)
    if (series.is_ct() &&
        (options.series_uid.empty() || series.first().series_uid == options.series_uid))
      matching.push_back(&series);
  if (matching.size() == 1) return *matching.front();
  if (!options.series_uid.empty())
    throw InputError(path.string(), "'series_uid' is " + in_quotes(options.series_uid) +
                                        ", must be one of CT among:" + candidates(all));
  if (matching.empty())
    throw InputError(path.string(), "holds no CT images, only:" + candidates(all));
  throw InputError(path.string(),
                   "holds " + std::to_string(matching.size()) +
                       " CT series; 'series_uid' must name one of:" + candidates(all));
}

std::vector<std::string> warnings_of(const Scan& scan, const std::vector<Series>& all,
                                     const Series& chosen) {
  std::vector<std::string> warnings;
  for (const Series& series : all)
    if (&series != &chosen)
      warnings.push_back("passed over: series " + uid_text(series.first().series_uid) +
                         " of modality " + series.first().modality + " (" +
                         std::to_string(series.images.size() + series.others.size()) + " files)");
  if (!chosen.others.empty())
    warnings.push_back("passed over: " + std::to_string(chosen.others.size()) +
                       " files of the series that are no CT images (" +
                       listed(chosen.others, [](const DicomFile* f) { return file_name(*f); }) +
                       ")");
  std::vector<std::string> localizers;
  for (const DicomFile* file : chosen.images)
    for (const DicomFrame& frame : file->images.frames)
      if (frame.localizer) localizers.push_back(frame.pose.name);
  if (!localizers.empty())
    warnings.push_back("passed over: " + std::to_string(localizers.size()) + " localizers (" +
                       listed(localizers, [](const std::string& name) { return name; }) + ")");
  if (!scan.not_dicom.empty())
    warnings.push_back(
        "passed over: " + std::to_string(scan.not_dicom.size()) + " files that are not DICOM (" +
        listed(scan.not_dicom, [](const fs::path& p) { return p.filename().string(); }) + ")");
  for (const std::string& warning : chosen.first().images.warnings)
    warnings.push_back(file_name(chosen.first()) + ": " + warning);
  if (chosen.first().series_uid.empty())
    warnings.push_back("'SeriesInstanceUID' is empty: files without one are taken as one series");
  return warnings;
}

/// Refuses what cannot become a volume, before any pixel is read.
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

[[noreturn]] void refuse_different(const std::string& source, const DicomFrame& a,
                                   const DicomFrame& b) {
  std::string message = "slices at one place differ in their pixels: '" + a.pose.name + "' and '" +
                        b.pose.name + "' at " + io::format(a.pose.position_mm) + " mm";
  if (a.acquisition_number && b.acquisition_number && a.acquisition_number != b.acquisition_number)
    message += ", of acquisitions " + std::to_string(*a.acquisition_number) + " and " +
               std::to_string(*b.acquisition_number) + "; 'acquisition_number' takes one of them";
  throw InputError(source, message);
}

/// The voxels of the slices in the stack's order. Slices at the same place must be the same.
std::vector<std::int16_t> load_voxels(const std::string& source, const std::vector<Slice>& slices,
                                      const SliceStack& stacked, const Progress& progress) {
  const auto slice = [&](int i) -> const Slice& { return slices[static_cast<std::size_t>(i)]; };
  const auto pixels_of = [&](int i) {
    return io::read_dicom_hounsfield(*slice(i).file, slice(i).frame);
  };
  // Memory for all is asked for when one has shown that its size is not just a claim.
  const std::size_t count = pixels_of(stacked.order.front()).size();
  std::vector<std::int16_t> voxels(count * stacked.order.size());
  const auto load = [&](int place) {
    const auto k = static_cast<std::size_t>(place);
    const std::vector<std::int16_t> pixels = pixels_of(stacked.order[k]);
    std::copy(pixels.begin(), pixels.end(), &voxels[k * count]);
    for (const int i : stacked.duplicates[k])
      if (pixels_of(i) != pixels)
        refuse_different(source, slice(stacked.order[k]).info(), slice(i).info());
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
  std::vector<Slice> slices = slices_of(series, options);
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
  if (!stacked.irregular.empty()) {
    std::vector<io::SlicePose> poses;
    for (const Slice& slice : slices) poses.push_back(slice.info().pose);
    return io::resample_stack(source, poses, stacked, voxels);
  }
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
  const Scan scan = scan_path(path);
  std::vector<DicomSeries> found;
  for (const Series& series : group_by_series(scan)) found.push_back(describe(series));
  return found;
}

LoadedCt read_dicom_ct(const fs::path& path, const DicomReadOptions& options,
                       const Progress& progress) {
  options.validate();
  const std::string source = path.string();
  const Scan scan = scan_path(path);
  const std::vector<Series> all = group_by_series(scan);
  const Series& series = select(path, all, options);
  const std::vector<Slice> slices = require_slices(source, series, options);

  LoadedCt ct;
  ct.format = "DICOM";
  ct.series_uid = series.first().series_uid;
  ct.frame_of_reference_uid = series.first().frame_of_reference_uid;
  ct.warnings = warnings_of(scan, all, series);
  const SliceStack stacked = stack(slices, options.position_tolerance);
  check_stack(source, stacked, options, ct.warnings);
  ct.volume = load_volume(source, slices, stacked, progress);
  ct.volume.grid.validate(source);
  for (std::size_t k = 0; k < stacked.order.size(); ++k)
    for (const int i : stacked.duplicates[k])
      ct.warnings.push_back(
          "passed over: '" + slices[static_cast<std::size_t>(i)].info().pose.name +
          "', the same slice as '" +
          slices[static_cast<std::size_t>(stacked.order[k])].info().pose.name + "'");
  return ct;
}

LoadedCt read_ct(const fs::path& path, const DicomReadOptions& options, const Progress& progress) {
  std::error_code error;
  if (!has_volume_extension(path) || fs::is_directory(path, error))
    return read_dicom_ct(path, options, progress);
  LoadedCt ct;
  const VolumeInfo info = read_volume_info(path);
  ct.format = info.format;
  ct.warnings = info.warnings;
  ct.volume = read_volume<std::int16_t>(path);
  return ct;
}

}  // namespace usct
