#include "io/dicom/dicom_report.h"

#include <algorithm>

#include "io/description.h"
#include "io/format.h"
#include "text.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

/// Greatest number of files that a message names.
constexpr std::size_t kNamed = 4;

std::string file_name(const DicomFile& file) { return file.path.filename().string(); }

/// The names of the first few items: "a, b, c, ...".
template <typename Item, typename Name>
std::string listed(const std::vector<Item>& items, const Name& name) {
  std::string out;
  for (std::size_t i = 0; i < std::min(items.size(), kNamed); ++i)
    out += (i > 0 ? ", " : "") + name(items[i]);
  return items.size() > kNamed ? out + ", ..." : out;
}

/// Whole, since series are chosen by it.
std::string uid_text(const std::string& uid) {
  return uid.empty() ? "(no SeriesInstanceUID)" : in_quotes(uid, uid.size()).substr(1, uid.size());
}

/// The first pair of slices at one place with different pixels, or pixels that cannot be read;
/// empty if all others are copies.
std::string first_different(const std::vector<Slice>& slices, const SliceStack& stacked) {
  const auto slice = [&](int i) -> const Slice& { return slices[static_cast<std::size_t>(i)]; };
  const auto pixels_of = [&](int i) {
    return read_dicom_hounsfield(*slice(i).file, slice(i).frame);
  };
  try {
    for (std::size_t k = 0; k < stacked.order.size(); ++k)
      for (const int i : stacked.duplicates[k])
        if (pixels_of(i) != pixels_of(stacked.order[k]))
          return different_pixels(slice(stacked.order[k]).info(), slice(i).info());
  } catch (const InputError& error) {
    return fs::path(error.source()).filename().string() + ": " + error.violation();
  }
  return "";
}

/// Reasons why the series would be refused or resampled.
std::vector<std::string> problems_of(const Series& series, const std::vector<Slice>& slices,
                                     const SliceStack& stacked) {
  std::vector<std::string> problems;
  for (const DicomFile* file : series.images)
    if (!file->problem.empty()) problems.push_back(file_name(*file) + ": " + file->problem);
  if (!problems.empty()) return problems;
  problems = stacked.fatal;
  problems.insert(problems.end(), stacked.irregular.begin(), stacked.irregular.end());
  if (!stacked.fatal.empty()) return problems;
  if (std::string different = first_different(slices, stacked); !different.empty())
    problems.push_back(std::move(different));
  return problems;
}

/// Slices of one stack have the same unit, but each may have its own padding.
void warn_of_values(const std::vector<Slice>& slices, std::vector<std::string>& warnings) {
  const DicomFrame& first = slices.front().info();
  if (first.unit != "HU")
    warnings.push_back(first.pose.name + ": 'RescaleType' is " + in_quotes(first.unit) +
                       ", not HU: the values may not be Hounsfield units");
  for (const Slice& slice : slices) {
    const auto& padding = slice.file->images.padding;
    if (!padding) continue;
    const DicomFrame& frame = slice.info();
    const auto hu = [&](long value) {
      return static_cast<double>(value) * frame.slope + frame.intercept;
    };
    const double greatest = std::max(hu(padding->first), hu(padding->second));
    if (greatest <= kAirHu) continue;
    warnings.push_back(frame.pose.name + ": 'PixelPaddingValue' declares values up to " +
                       format(greatest) + " HU as not measured: those of more than " +
                       format(kDensestTissueHu) + " HU are read as air, others as they are");
    return;
  }
}

}  // namespace

DicomSeries summarise(const Series& series) {
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
  const SliceStack stacked = stack_of(slices, defaults.position_tolerance);
  out.problems = problems_of(series, slices, stacked);
  out.slices = static_cast<int>(stacked.order.empty() ? slices.size() : stacked.order.size());
  if (slices.empty()) return out;
  const SlicePose& pose = slices.front().info().pose;
  out.columns = pose.size.x();
  out.rows = pose.size.y();
  out.axes = pose.axes;
  out.spacing_mm << pose.spacing_mm, stacked.spacing_mm;
  return out;
}

std::string list_series(const std::vector<Series>& all) {
  std::string out;
  for (const Series& series : all) {
    const DicomSeries d = summarise(series);
    out += "\n  " + uid_text(d.series_uid) + ": " + d.modality + ", ";
    if (d.series_number) out += "series number " + std::to_string(*d.series_number) + ", ";
    if (d.is_ct)
      out += std::to_string(d.slices) + " slices of " + std::to_string(d.columns) + " x " +
             std::to_string(d.rows) + ", spacing " + format(d.spacing_mm) + " mm";
    else
      out += std::to_string(d.files) + " files";
    if (!d.problems.empty()) out += " (" + d.problems.front() + ")";
  }
  return out;
}

std::string different_pixels(const DicomFrame& a, const DicomFrame& b) {
  std::string text = "slices at one place differ in their pixels: '" + a.pose.name + "' and '" +
                     b.pose.name + "' at " + format(a.pose.position_mm) + " mm";
  if (a.acquisition_number && b.acquisition_number && a.acquisition_number != b.acquisition_number)
    text += ", of acquisitions " + std::to_string(*a.acquisition_number) + " and " +
            std::to_string(*b.acquisition_number) + "; 'acquisition_number' takes one of them";
  return text;
}

std::vector<std::string> warnings_of(const DicomScan& scan, const std::vector<Series>& all,
                                     const Series& chosen, const std::vector<Slice>& slices) {
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
  if (!scan.linked_folders.empty())
    warnings.push_back(
        "passed over: " + std::to_string(scan.linked_folders.size()) +
        " links to folders, which are not followed (" +
        listed(scan.linked_folders, [](const fs::path& p) { return p.filename().string(); }) + ")");
  if (!scan.not_dicom.empty())
    warnings.push_back(
        "passed over: " + std::to_string(scan.not_dicom.size()) + " files that are not DICOM (" +
        listed(scan.not_dicom, [](const fs::path& p) { return p.filename().string(); }) + ")");
  if (!scan.not_parsed.empty())
    warnings.push_back(
        "passed over: " + std::to_string(scan.not_parsed.size()) +
        " files that cannot be read, and state that they are no CT images (" +
        listed(scan.not_parsed, [](const fs::path& p) { return p.filename().string(); }) + ")");
  warn_of_values(slices, warnings);
  if (chosen.first().series_uid.empty())
    warnings.push_back("'SeriesInstanceUID' is empty: files without one are taken as one series");
  return warnings;
}

}  // namespace usct::io

namespace usct {
namespace {

using io::Json;

/// A series without problems is read, so that its range is known and damage to its pixels is found.
void describe_voxels(const std::filesystem::path& path, const DicomSeries& series, Json& json) {
  DicomReadOptions options;
  options.series_uid = series.series_uid;
  const LoadedCt ct = read_dicom_ct(path, options);
  json["warnings"] = ct.warnings;
  io::describe_range(ct.volume.voxels, json);
}

}  // namespace

std::string describe_dicom(const std::filesystem::path& path) {
  Json json;
  json["series"] = Json::array();
  const std::vector<DicomSeries> all = find_dicom_series(path);
  const bool are_many =
      std::count_if(all.begin(), all.end(), [](const DicomSeries& s) { return s.is_ct; }) > 1;
  for (const DicomSeries& series : all) {
    Json entry;
    entry["series_uid"] = series.series_uid;
    entry["modality"] = series.modality;
    entry["files"] = series.files;
    if (series.is_ct) {
      entry["size"] = {series.columns, series.rows, series.slices};
      entry["spacing_mm"] = io::list(series.spacing_mm);
      entry["columns_run_to"] = io::list(series.axes.col(0));
      entry["rows_run_to"] = io::list(series.axes.col(1));
      entry["frame_of_reference_uid"] = series.frame_of_reference_uid;
      entry["transfer_syntax_uid"] = series.transfer_syntax_uid;
      std::vector<std::string> problems = series.problems;
      if (series.series_uid.empty() && are_many)
        problems.emplace_back(
            "'SeriesInstanceUID' is empty, so that no option chooses this series among the others: "
            "move its files into a folder of their own");
      entry["problems"] = problems;
      if (problems.empty()) describe_voxels(path, series, entry);
    }
    json["series"].push_back(entry);
  }
  return io::as_text(json);
}

}  // namespace usct
