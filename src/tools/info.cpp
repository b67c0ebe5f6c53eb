#include <cstdio>

#include "commands.h"
#include "describe.h"
#include "exit_status.h"

namespace usct::tools {
namespace {

struct InfoOptions {
  std::vector<std::string> paths;
  bool json = false;
};

/// Six digits are enough to read; --json has all.
std::string text_of(const nlohmann::ordered_json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.6g", value.get<double>());
    return text;
  }
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const auto& entry : value) text += (text.empty() ? "" : " ") + text_of(entry);
  return text;
}

/// One key per line; lists of values on the line, lists of objects and texts below it.
void print(const nlohmann::ordered_json& object, int indent) {
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
  auto all = nlohmann::ordered_json::array();
  for (const std::string& path : options.paths) {
    const auto description = describe(path);
    if (options.json)
      all.push_back(description);
    else
      print(description, 0);
  }
  if (options.json) std::printf("%s\n", (all.size() == 1 ? all.front() : all).dump(2).c_str());
  return kDone;
}

}  // namespace

void add_info_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "info",
      "Tells what a file or DICOM folder holds: kind, geometry, spacing, orientation, range, "
      "warnings. Positions are in millimetres (mm), LPS for CT (axes_run_to: L left, P posterior, "
      "S "
      "superior, "
      "and R, A, I the other way); angles are degrees. Never prints a patient's identity.");
  auto options = std::make_shared<InfoOptions>();
  command->add_option("path", options->paths, "files or DICOM folders")->required();
  command->add_flag("--json", options->json, "print JSON, for programs");
  command->callback([options, &run] { run = [options] { return run_info(*options); }; });
}

}  // namespace usct::tools
