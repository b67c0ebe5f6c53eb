#include "ros/node/data_root.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <system_error>
#include <vector>

#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;

/// Whether other files of the folder are read as well, as for a DICOM series or a header with
/// detached data.
bool is_one_of_several(const fs::path& file) {
  const std::string extension = file.extension().string();
  return !has_volume_extension(file) || extension == ".nhdr" || extension == ".mhd";
}

template <typename F>
void for_each_entry(const fs::path& folder, bool with_subfolders, F&& work) {
  std::error_code error;
  if (with_subfolders) {
    for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
         it.increment(error))
      work(*it);
  } else {
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
      work(*it);
  }
}

bool is_part_of_name(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
}

/// Short numbers stay in a text: they occur in sentences as well, and they name nobody.
bool is_short_number(const std::string& name) {
  return name.size() <= 3 && std::all_of(name.begin(), name.end(),
                                         [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// Whether text[begin, end) is a whole name and not a part of a longer one.
bool stands_alone(const std::string& text, std::size_t begin, std::size_t end) {
  const bool goes_on_left =
      begin > 0 && is_part_of_name(text[begin - 1]) && is_part_of_name(text[begin]);
  const bool goes_on_right =
      end < text.size() && is_part_of_name(text[end]) && is_part_of_name(text[end - 1]);
  return !goes_on_left && !goes_on_right;
}

void replace_all(std::string& text, const std::string& name, const std::string& replacement) {
  if (name.empty()) return;  // it would be found everywhere, and never end
  std::size_t at = 0;
  while ((at = text.find(name, at)) != std::string::npos) {
    const bool is_it = stands_alone(text, at, at + name.size());
    if (is_it) text.replace(at, name.size(), replacement);
    at += is_it ? replacement.size() : name.size();
  }
}

}  // namespace

DataRoot::DataRoot(const fs::path& root, const std::string& parameter) : parameter_(parameter) {
  std::error_code error;
  const auto refuse = [&](const std::string& why) {
    throw InputError(parameter, "is '" + root.string() + "', " + why);
  };
  if (!root.is_absolute()) refuse("must be the whole path of a folder");
  root_ = fs::canonical(root, error);
  if (error) refuse("which cannot be opened: " + error.message());
  if (!fs::is_directory(root_, error)) refuse("must be a folder");
}

bool DataRoot::is_below(const fs::path& path) const {
  return std::mismatch(root_.begin(), root_.end(), path.begin(), path.end()).first == root_.end();
}

void DataRoot::require_no_link_out(const fs::path& folder, bool with_subfolders,
                                   const std::string& field) const {
  for_each_entry(folder, with_subfolders, [&](const fs::directory_entry& entry) {
    std::error_code error;
    if (!entry.is_symlink(error) || entry.is_directory(error)) return;
    if (!is_below(fs::weakly_canonical(entry.path(), error)) || error)
      throw PathRefused("'" + field + "': the folder has a link that leads out of the data root");
  });
}

fs::path DataRoot::below(const std::string& given, const std::string& field) const {
  if (given.empty()) throw InputError("'" + field + "'", "is empty");
  if (given.find('\0') != std::string::npos) throw InputError("'" + field + "'", "has a zero byte");
  std::error_code error;
  const fs::path path = fs::weakly_canonical(root_ / given, error);
  if (error || !is_below(path))
    throw PathRefused("'" + field + "' is '" + given +
                      "', must lie below the data root (parameter " + parameter_ +
                      ") after links and .. are resolved");
  return path;
}

fs::path DataRoot::resolve_new(const std::string& given, const std::string& field) const {
  return below(given, field);
}

fs::path DataRoot::resolve(const std::string& given, const std::string& field) const {
  const fs::path path = below(given, field);
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(given, "does not exist");
  if (!fs::is_directory(status) && !fs::is_regular_file(status))
    throw InputError(given, "is neither a folder nor a file");
  if (fs::is_directory(status))
    require_no_link_out(path, true, field);
  else if (is_one_of_several(path))
    require_no_link_out(path.parent_path(), false, field);
  return path;
}

std::string without_names(const std::string& text, const fs::path& path, const std::string& given) {
  std::error_code error;
  const bool is_folder = fs::is_directory(path, error);
  const fs::path folder = is_folder ? path : path.parent_path();
  std::set<fs::path> entries;
  for_each_entry(folder, is_folder, [&](const fs::directory_entry& entry) {
    if (entry.path() != path) entries.insert(entry.path());
  });
  // The path that the caller gave may contain such names as well, so it is put in last, and so is
  // its folder.
  const std::string place_of_given(1, '\0');
  const std::string place_of_folder(1, '\1');
  const std::string given_folder = fs::path(given).parent_path().string();
  std::vector<std::pair<std::string, std::string>> replacements{{path.string(), place_of_given},
                                                                {given, place_of_given}};
  if (!is_folder) replacements.emplace_back(path.filename().string(), place_of_given);
  std::size_t number = 0;
  for (const fs::path& entry : entries) {
    const std::string shown = "file " + std::to_string(++number);
    replacements.emplace_back(entry.string(), shown);
    const std::string name = entry.filename().string();
    if (!is_short_number(name)) replacements.emplace_back(name, shown);
  }
  replacements.emplace_back(folder.string(), given_folder.empty() ? "." : place_of_folder);
  // The longest name goes first, because one name may begin with another.
  std::stable_sort(replacements.begin(), replacements.end(),
                   [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
  std::string shown = text;
  for (const auto& [name, replacement] : replacements) replace_all(shown, name, replacement);
  replace_all(shown, place_of_given, given);
  replace_all(shown, place_of_folder, given_folder);
  return shown;
}

}  // namespace usct::ros_interface
