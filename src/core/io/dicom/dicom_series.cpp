#include "io/dicom/dicom_series.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "io/dicom/dicom_report.h"
#include "parallel.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

struct Listing {
  std::vector<fs::path> files;
  std::vector<fs::path> linked_folders;
};

/// The files of a folder; its subfolders are entered if `with_subfolders`. Throws InputError for a
/// link that leads nowhere, to data that was not fetched or a disk that is not mounted: of slices
/// that are missing at an end of the CT nothing else tells.
Listing list_files(const fs::path& folder, bool with_subfolders) {
  Listing found;
  std::error_code error;
  const auto add = [&](const fs::directory_entry& entry) {
    std::error_code ignored;
    if (entry.is_regular_file(ignored))
      found.files.push_back(entry.path());
    else if (entry.is_symlink(ignored) && !entry.exists(ignored))
      throw InputError(entry.path().string(), "is a link to a file that does not exist");
    else if (entry.is_symlink(ignored) && entry.is_directory(ignored))
      found.linked_folders.push_back(entry.path());
  };
  fs::path at = folder;  // the folder that is read next
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    add(*it);
    if (!with_subfolders) it.disable_recursion_pending();
    const bool is_entered =
        it.recursion_pending() && it->symlink_status(error).type() == fs::file_type::directory;
    at = is_entered ? it->path() : it->path().parent_path();
  }
  if (error) throw InputError(at.string(), "folder cannot be read: " + error.message());
  std::sort(found.files.begin(), found.files.end());
  return found;
}

DicomScan scan_files(const std::vector<fs::path>& paths) {
  std::vector<std::optional<DicomFile>> read(paths.size());
  parallel_for(static_cast<int>(paths.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    read[at] = read_dicom_header(paths[at]);
  });
  DicomScan scan;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (!read[i])
      scan.not_dicom.push_back(paths[i]);
    else if (read[i]->kind == DicomKind::kNotParsed)
      scan.not_parsed.push_back(paths[i]);
    else if (read[i]->kind != DicomKind::kDirectory)
      scan.files.push_back(std::move(*read[i]));
  }
  return scan;
}

DicomScan scan_folder(const fs::path& folder) {
  Listing found = list_files(folder, true);
  DicomScan scan = scan_files(found.files);
  scan.linked_folders = std::move(found.linked_folders);
  if (scan.files.empty())
    throw InputError(folder.string(),
                     "folder holds no DICOM files (" +
                         std::to_string(scan.not_dicom.size() + scan.not_parsed.size()) +
                         " others)");
  return scan;
}

/// The files in the folder of `path` that belong to its series.
DicomScan scan_series_of(const fs::path& path) {
  const std::optional<DicomFile> file = read_dicom_header(path);
  if (!file) throw InputError(path.string(), "is not a DICOM file");
  if (file->kind == DicomKind::kNotParsed) throw InputError(path.string(), file->problem);
  if (file->kind == DicomKind::kDirectory)
    throw InputError(path.string(),
                     "is a DICOMDIR; must be the folder that it lies in, or an image");
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  DicomScan scan = scan_files(list_files(folder, false).files);
  const auto other = [&](const DicomFile& f) {
    return f.series_uid != file->series_uid || f.modality != file->modality;
  };
  scan.files.erase(std::remove_if(scan.files.begin(), scan.files.end(), other), scan.files.end());
  scan.not_dicom.clear();
  scan.not_parsed.clear();
  return scan;
}

}  // namespace

DicomScan scan_dicom(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status))
    throw InputError(path.string(), status.type() == fs::file_type::not_found
                                        ? "does not exist"
                                        : "cannot be opened: " + error.message());
  return fs::is_directory(status) ? scan_folder(path) : scan_series_of(path);
}

std::vector<Series> group_by_series(const DicomScan& scan) {
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

const Series& choose_series(const fs::path& path, const std::vector<Series>& all,
                            const DicomReadOptions& options) {
  std::vector<const Series*> matching;
  for (const Series& series : all)
    if (series.is_ct() &&
        (options.series_uid.empty() || series.first().series_uid == options.series_uid))
      matching.push_back(&series);
  if (matching.size() == 1) return *matching.front();
  if (!options.series_uid.empty())
    throw InputError(path.string(), "'series_uid' is " +
                                        in_quotes(options.series_uid, options.series_uid.size()) +
                                        ", must be one of CT among:" + list_series(all));
  if (matching.empty())
    throw InputError(path.string(), "holds no CT images, only:" + list_series(all));
  throw InputError(path.string(),
                   "holds " + std::to_string(matching.size()) +
                       " CT series; 'series_uid' must name one of:" + list_series(all));
}

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
  // A stack keeps the first slice of those at one place. If two acquisitions have the same places,
  // it is then the same one's everywhere.
  std::stable_sort(slices.begin(), slices.end(), [](const Slice& a, const Slice& b) {
    return a.info().acquisition_number < b.info().acquisition_number;
  });
  return slices;
}

std::vector<SlicePose> poses_of(const std::vector<Slice>& slices) {
  std::vector<SlicePose> poses;
  for (const Slice& slice : slices) poses.push_back(slice.info().pose);
  return poses;
}

/// Two acquisitions of one place, half a slice apart, would become one CT of alternating slices.
/// Acquisitions one after the other, or one for each turn of the gantry, each have a range.
void report_alternating(const std::vector<Slice>& slices, SliceStack& stack) {
  std::set<std::optional<int>> numbers;
  std::size_t changes = 0;
  const Slice* before = nullptr;
  for (const int at : stack.order) {
    const Slice& slice = slices[static_cast<std::size_t>(at)];
    numbers.insert(slice.info().acquisition_number);
    changes += before && before->info().acquisition_number != slice.info().acquisition_number;
    before = &slice;
  }
  const bool have_ranges = changes < numbers.size();
  if (!have_ranges && 2 * changes >= stack.order.size())
    stack.fatal.push_back("slices of " + std::to_string(numbers.size()) +
                          " acquisitions alternate; 'acquisition_number' must name one");
}

template <typename Value>
void report_mixed(const std::vector<Slice>& slices, const char* attribute, const Value& value_of,
                  SliceStack& stack) {
  const auto text = [&](const Slice& slice) {
    return in_quotes(value_of(slice)) + " in '" + slice.info().pose.name + "'";
  };
  for (const Slice& slice : slices)
    if (value_of(slice) != value_of(slices.front())) {
      stack.fatal.push_back("slices differ in '" + std::string(attribute) +
                            "': " + text(slices.front()) + ", " + text(slice));
      return;
    }
}

SliceStack stack_of(const std::vector<Slice>& slices, double tolerance) {
  SliceStack stack = stack_slices(poses_of(slices), tolerance);
  if (stack.fatal.empty()) report_alternating(slices, stack);
  report_mixed(
      slices, "FrameOfReferenceUID",
      [](const Slice& slice) { return slice.file->frame_of_reference_uid; }, stack);
  report_mixed(
      slices, "RescaleType", [](const Slice& slice) { return slice.info().unit; }, stack);
  return stack;
}

}  // namespace usct::io
