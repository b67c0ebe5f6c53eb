#include "ultrasound_options.h"

#include <vector>

#include "inputs.h"
#include "option_checks.h"
#include "us_ct_registration/io/formats.h"

namespace usct::tools {
namespace {

/// The help of an option, and in brackets the formats that need or can use it.
std::string help_of(const UltrasoundOption& option) {
  std::string needed;
  std::string usable;
  for (const FileFormat& format : file_formats()) {
    if (!format.ultrasound || !format.ultrasound->can_use(option.field)) continue;
    std::string& names = format.ultrasound->needs(option.field) ? needed : usable;
    names += (names.empty() ? "" : ", ") + format.name;
  }
  std::string formats = needed.empty() ? "" : "needed: " + needed;
  if (!usable.empty()) formats += (formats.empty() ? "" : "; ") + ("for: " + usable);
  return std::string(option.help) + " [" + formats + "]";
}

CLI::Option* add_option(CLI::App& group, const UltrasoundOption& option, bool& value) {
  return group.add_flag(option.flag, value, help_of(option));
}

CLI::Option* add_option(CLI::App& group, const UltrasoundOption& option,
                        std::optional<Eigen::Vector2d>& value) {
  const auto set = [&value](const std::vector<double>& numbers) {
    value = Eigen::Vector2d(numbers[0], numbers[1]);
  };
  return group.add_option_function<std::vector<double>>(option.flag, set, help_of(option))
      ->expected(2);
}

CLI::Option* add_option(CLI::App& group, const UltrasoundOption& option,
                        std::filesystem::path& value) {
  return group.add_option(option.flag, value, help_of(option));
}

template <typename T>
CLI::Option* add_option(CLI::App& group, const UltrasoundOption& option, T& value) {
  return group.add_option(option.flag, value, help_of(option))->capture_default_str();
}

}  // namespace

CLI::App* UltrasoundOptions::add_to(CLI::App& command) {
  CLI::App* formats = command.add_option_group("What a format of ultrasound leaves open");
  for (const UltrasoundOption& option : ultrasound_options())
    std::visit([&](const auto field) { add_option(*formats, option, source_.*field); },
               option.field);
  return formats;
}

void UltrasoundOptions::add_compounding_to(CLI::App& command) {
  compounding_command_ = &command;
  CLI::App* tracked = command.add_option_group("Compounding of tracked frames");
  tracked
      ->add_option("--slice-thickness", compounding_.slice_thickness_mm,
                   "a frame fills voxels within half of this from its plane, mm")
      ->capture_default_str();
  tracked
      ->add_option("--hole-fill", compounding_.hole_fill_radius_mm,
                   "bridge gaps between frames up to this distance on either side, mm")
      ->capture_default_str();
  tracked->add_option("--compounding", compounding_.compounding, "where several frames meet")
      ->transform(named<Compounding>({{"mean", Compounding::kMean},
                                      {"maximum", Compounding::kMaximum},
                                      {"latest", Compounding::kLatest}}));
}

const CompoundOptions& UltrasoundOptions::compounding(const Ultrasound& ultrasound) const {
  const auto* beams = std::get_if<PreScanVolume>(&ultrasound);
  const bool tracked = beams != nullptr ? !beams->geometry.is_motorised()
                                        : std::holds_alternative<TrackedImages>(ultrasound);
  if (!tracked) require_no_compounding("the ultrasound has tracked frames");
  return compounding_;
}

void UltrasoundOptions::require_no_compounding(const std::string& condition) const {
  require_left_out(*compounding_command_, {"--slice-thickness", "--hole-fill", "--compounding"},
                   condition);
}

UltrasoundSource UltrasoundOptions::source(const std::string& path) const {
  UltrasoundSource source = source_;
  source.path = path;
  return source;
}

Ultrasound read_ultrasound_with_warnings(const UltrasoundSource& source) {
  UltrasoundInput input = read_ultrasound(source);
  print_warnings(input.warnings);
  return std::move(input.data);
}

}  // namespace usct::tools
