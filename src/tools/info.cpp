#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "exit_status.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/formats.h"

namespace usct::tools {
namespace {

struct InfoOptions {
  std::vector<std::string> paths;
  bool json = false;
};

using Json = nlohmann::ordered_json;

Json description_of(const std::filesystem::path& path) {
  const FileFormat& format = detect_format(path);
  Json json;
  json["file"] = path.string();
  json["kind"] = format.name;
  json.update(Json::parse(format.describe(path)));
  return json;
}

/// Nothing, and an error on standard error, for a file that cannot be read: the other files of the
/// command line are described all the same.
std::optional<Json> description_or_error(const std::string& path) {
  try {
    return description_of(path);
  } catch (const InputError& error) {
    std::fprintf(stderr, "usct: error: %s\n", error.what());
  } catch (const std::filesystem::filesystem_error& error) {  // such as a folder nobody may read
    std::fprintf(stderr, "usct: error: %s: %s\n", error.path1().c_str(),
                 error.code().message().c_str());
  }
  return std::nullopt;
}

/// A value for people, with six digits; --json prints all digits.
std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return formatted("%.6g", value.get<double>());
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const auto& entry : value) text += (text.empty() ? "" : " ") + text_of(entry);
  return text;
}

/// Prints one key per line. A list of numbers stands on the line of its key, a list of objects or
/// lists below it; a list of texts repeats the key for each text.
void print(const Json& object, int indent) {
  for (const auto& [key, value] : object.items()) {
    const std::string margin(static_cast<std::size_t>(indent), ' ');
    if (value.is_object()) {
      std::printf("%s%s:\n", margin.c_str(), key.c_str());
      print(value, indent + 2);
    } else if (value.is_array() && !value.empty() && value.front().is_structured()) {
      std::printf("%s%s:\n", margin.c_str(), key.c_str());
      for (const auto& entry : value) {
        if (entry.is_object())
          print(entry, indent + 2);
        else
          std::printf("%s  %s\n", margin.c_str(), text_of(entry).c_str());
      }
    } else if (value.is_array() && !value.empty() && value.front().is_string()) {
      for (const auto& entry : value)
        std::printf("%s%s: %s\n", margin.c_str(), key.c_str(), entry.get<std::string>().c_str());
    } else if (!value.is_array() || !value.empty()) {
      std::printf("%s%s: %s\n", margin.c_str(), key.c_str(), text_of(value).c_str());
    }
  }
}

int run_info(const InfoOptions& options) {
  auto all = Json::array();
  int status = kDone;
  for (const std::string& path : options.paths) {
    const std::optional<Json> description = description_or_error(path);
    if (!description)
      status = kBadInput;
    else if (options.json)
      all.push_back(*description);
    else
      print(*description, 0);
  }
  const bool is_one = options.paths.size() == 1;
  if (options.json && !(is_one && all.empty()))
    std::printf(
        "%s\n",
        (is_one ? all.front() : all).dump(2, ' ', false, Json::error_handler_t::replace).c_str());
  return status;
}

}  // namespace

void add_info_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "info",
      "Tells what a file or DICOM folder holds: kind, geometry, spacing, orientation, range, "
      "warnings. Positions are in millimetres (mm), LPS for CT (axes_run_to: L left, P posterior, "
      "S superior, and R, A, I the other way); angles are degrees. Never prints a patient's "
      "identity.");
  auto options = std::make_shared<InfoOptions>();
  command->add_option("path", options->paths, "files or DICOM folders")->required();
  command->add_flag("--json", options->json, "print JSON, for programs");
  command->callback([options, &run] { run = [options] { return run_info(*options); }; });
}

}  // namespace usct::tools
