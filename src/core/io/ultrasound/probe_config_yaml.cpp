#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "io/description.h"
#include "io/yaml_keys.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"

namespace usct {
namespace {

using io::YamlKeys;

constexpr const char* kMotorised = "motorised_curvilinear";
constexpr const char* kCurvilinear = "curvilinear";
constexpr const char* kLinear = "linear";

/// Reads the places of lines in the file's unit: a table, or a number of lines with a pitch.
std::vector<double> read_lines(YamlKeys& keys, const std::string& table_key,
                               const std::string& pitch_key) {
  const bool has_table = keys.has(table_key);
  if (has_table == keys.has(pitch_key))
    throw InputError(keys.source(), "must have one of '" + table_key + "' and '" + pitch_key +
                                        "', has " + (has_table ? "both" : "neither"));
  if (has_table) return keys.table(table_key);
  constexpr int kMostLines = 65536;
  const int lines = keys.whole_number("lines");
  if (lines < 2 || lines > kMostLines)
    throw InputError(keys.source(), "'lines' is " + std::to_string(lines) + ", must be 2 to " +
                                        std::to_string(kMostLines));
  return centred_table(lines, keys.number(pitch_key));
}

Array read_array(YamlKeys& keys, const std::string& kind) {
  if (kind == kLinear) return LinearArray{read_lines(keys, "line_positions_mm", "line_pitch_mm")};
  return CurvilinearArray{keys.number("probe_radius_mm"),
                          radians(read_lines(keys, "line_angles_deg", "line_pitch_deg"))};
}

ProbeMotor read_motor(YamlKeys& keys) {
  ProbeMotor motor;
  motor.motor_radius_mm = keys.number("motor_radius_mm");
  if (const auto step = keys.optional_number("motor_step_deg")) motor.step_rad = radians(*step);
  if (keys.has("motor_steps_per_frame"))
    motor.steps_per_frame = keys.whole_number("motor_steps_per_frame");
  if (keys.has("frame_angles_deg"))
    motor.frame_angles_rad = radians(keys.table("frame_angles_deg"));
  motor.frame_travel_rad = radians(keys.optional_number("frame_travel_deg").value_or(0.0));
  return motor;
}

/// Collects the text of a YAML file.
class YamlText {
 public:
  void comment(const std::string& text) { text_ += "# " + text + "\n"; }
  void line(const std::string& key, const std::string& value) {
    text_ += key + ": " + value + "\n";
  }
  void number(const std::string& key, double value) { line(key, format_double(value)); }
  void table(const std::string& key, const std::vector<double>& values) {
    std::string list;
    for (const double value : values) list += (list.empty() ? "" : ", ") + format_double(value);
    line(key, "[" + list + "]");
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void write_lines(const std::vector<double>& values, double unit, const std::string& table_key,
                 const std::string& pitch_key, YamlText& yaml) {
  constexpr double kTolerance = 1e-12;
  const int lines = static_cast<int>(values.size());
  const double pitch = (values.back() - values.front()) / (lines - 1);
  const std::vector<double> even = centred_table(lines, pitch);
  if (std::equal(values.begin(), values.end(), even.begin(),
                 [](double a, double b) { return std::abs(a - b) <= kTolerance; })) {
    yaml.comment("Evenly spaced lines, centred on the axial direction; positive towards +x.");
    yaml.line("lines", std::to_string(lines));
    yaml.number(pitch_key, pitch * unit);
    return;
  }
  std::vector<double> table = values;
  for (double& value : table) value *= unit;
  yaml.comment("One entry per line; positive towards +x (lateral).");
  yaml.table(table_key, table);
}

void write_array(const Array& array, YamlText& yaml) {
  if (const auto* linear = std::get_if<LinearArray>(&array))
    return write_lines(linear->line_positions_mm, 1.0, "line_positions_mm", "line_pitch_mm", yaml);
  const auto& curved = std::get<CurvilinearArray>(array);
  yaml.comment("Distance from the centre of curvature to the array's surface.");
  yaml.number("probe_radius_mm", curved.probe_radius_mm);
  write_lines(curved.line_angles_rad, 1.0 / kDegree, "line_angles_deg", "line_pitch_deg", yaml);
}

void write_motor(const ProbeMotor& motor, YamlText& yaml) {
  yaml.comment("Distance from the motor axis to the array's surface.");
  yaml.number("motor_radius_mm", motor.motor_radius_mm);
  if (motor.step_rad) {
    yaml.comment("One step of the motor.");
    yaml.number("motor_step_deg", degrees(*motor.step_rad));
  }
  if (motor.steps_per_frame) {
    yaml.comment("Motor steps from one frame to the next.");
    yaml.line("motor_steps_per_frame", std::to_string(*motor.steps_per_frame));
  }
  if (!motor.frame_angles_rad.empty()) {
    yaml.comment("Motor angle at the middle of each frame, in the order of a forward sweep.");
    yaml.table("frame_angles_deg", degrees(motor.frame_angles_rad));
  }
  yaml.comment("Motor travel while one frame is acquired, first line to last; 0 if it stops.");
  yaml.number("frame_travel_deg", degrees(motor.frame_travel_rad));
}

void write_sampling(const ProbeSampling& sampling, YamlText& yaml) {
  yaml.comment("Depth of the first sample below the array's surface.");
  yaml.number("start_depth_mm", sampling.start_depth_mm);
  const auto write = [&](const std::string& key, const std::optional<double>& value,
                         const std::string& comment) {
    if (!value) return;
    yaml.comment(comment);
    yaml.number(key, *value);
  };
  write("sample_spacing_mm", sampling.sample_spacing_mm, "Pitch of the samples along a line.");
  write("imaging_depth_mm", sampling.imaging_depth_mm, "Number of samples times their pitch.");
  write("sampling_frequency_hz", sampling.sampling_frequency_hz, "Of the stored samples.");
  write("speed_of_sound_m_per_s", sampling.speed_of_sound_m_per_s,
        "Sample pitch = speed of sound / (2 x sampling frequency).");
}

const char* kind_of(const ProbeConfig& probe) {
  if (probe.motor) return kMotorised;
  return std::holds_alternative<LinearArray>(probe.array) ? kLinear : kCurvilinear;
}

}  // namespace

ProbeConfig read_probe_config(const std::filesystem::path& path) {
  YamlKeys keys(io::read_yaml(path), path.string());
  ProbeConfig probe;
  probe.name = keys.text("name");
  const std::string kind = keys.text("kind");
  if (kind != kMotorised && kind != kCurvilinear && kind != kLinear)
    throw InputError(keys.source(), "'kind' is " + in_quotes(kind) +
                                        ", must be motorised_curvilinear, curvilinear or linear");
  probe.array = read_array(keys, kind);
  if (kind == kMotorised) probe.motor = read_motor(keys);
  probe.sampling.start_depth_mm = keys.number("start_depth_mm");
  probe.sampling.sample_spacing_mm = keys.optional_number("sample_spacing_mm");
  probe.sampling.imaging_depth_mm = keys.optional_number("imaging_depth_mm");
  probe.sampling.sampling_frequency_hz = keys.optional_number("sampling_frequency_hz");
  probe.sampling.speed_of_sound_m_per_s = keys.optional_number("speed_of_sound_m_per_s");
  keys.refuse_unknown(", or not one of this kind of probe");
  probe.validate(keys.source());
  return probe;
}

void write_probe_config(const ProbeConfig& probe, const std::filesystem::path& path) {
  probe.validate(path.string());
  YamlText yaml;
  yaml.comment("Geometry of an ultrasound probe; millimetres and degrees.");
  YAML::Emitter name;  // quotes and escapes special characters
  name << probe.name;
  yaml.line("name", name.c_str());
  yaml.line("kind", kind_of(probe));
  write_array(probe.array, yaml);
  if (probe.motor) write_motor(*probe.motor, yaml);
  write_sampling(probe.sampling, yaml);
  write_text(path, yaml.text());
}

std::string describe_probe_config(const std::filesystem::path& path) {
  const ProbeConfig probe = read_probe_config(path);
  io::Json json;
  json["name"] = probe.name;
  json["lines"] = line_count(probe.array);
  io::describe_array(probe.array, json);
  if (probe.motor) json["motor_radius_mm"] = probe.motor->motor_radius_mm;
  return io::as_text(json);
}

}  // namespace usct
