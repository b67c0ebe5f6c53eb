#include "ros/ingest/ultrasound_file.h"

#include <boost/make_shared.hpp>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <utility>

#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

::ros::Time stamp_of(const PreScanVolume& volume, FileStamp stamp, const ::ros::Time& now,
                     const std::string& source) {
  if (stamp == FileStamp::kReading) return now;
  if (volume.acquisition_time.empty())
    throw InputError(source,
                     "has no acquisition time; with the parameter file_stamp at 'reading' it would "
                     "be stamped with the time at which it is read");
  return time_from_utc(volume.acquisition_time, source);
}

void read(Parameters& parameters, const char* key, std::filesystem::path& value) {
  value = parameters.text(key, value.string());
}
void read(Parameters& parameters, const char* key, std::string& value) {
  value = parameters.text(key, value);
}
void read(Parameters& parameters, const char* key, int& value) {
  value = parameters.whole(key, value, 0);
}
void read(Parameters& parameters, const char* key, bool& value) {
  value = parameters.flag(key, value);
}
void read(Parameters& parameters, const char* key, std::optional<Eigen::Vector2d>& value) {
  const std::vector<double> numbers = parameters.numbers(key, 2);
  if (!numbers.empty()) value = Eigen::Vector2d(numbers[0], numbers[1]);
}

}  // namespace

UltrasoundSource read_ultrasound_source(Parameters& parameters) {
  UltrasoundSource source;
  source.path = parameters.text("path", "");
  for (const UltrasoundOption& option : ultrasound_options())
    std::visit([&](const auto field) { read(parameters, option.name, source.*field); },
               option.field);
  source.validate();
  return source;
}

::ros::Time time_from_utc(const std::string& text, const std::string& source) {
  std::tm date{};
  double seconds = 0.0;
  char zone = 0;
  const int found =
      std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d:%lf%c", &date.tm_year, &date.tm_mon,
                  &date.tm_mday, &date.tm_hour, &date.tm_min, &seconds, &zone);
  if (found != 7 || zone != 'Z' || date.tm_year < 1970 || date.tm_year > 2105)
    throw InputError(source, "'acquisition_time' is '" + text +
                                 "', must be ISO 8601 in UTC between 1970 and 2105");
  date.tm_year -= 1900;
  date.tm_mon -= 1;
  const double whole = std::floor(seconds);
  ::ros::Time time;
  time.sec = static_cast<std::uint32_t>(timegm(&date) + static_cast<std::time_t>(whole));
  constexpr double kNanosecondsPerSecond = 1e9;
  time.nsec = static_cast<std::uint32_t>((seconds - whole) * kNanosecondsPerSecond);
  return time;
}

std::string awaited(FileStamp stamp, const ::ros::Time& now, double sweep_s) {
  if (stamp != FileStamp::kReading || now.toSec() > sweep_s) return "";
  return "file_stamp is 'reading', and waits for simulated time (/clock) to pass " +
         seconds_text(sweep_s) + " s; it is at " + seconds_text(now) + " s";
}

double sweep_seconds(const PreScanVolume& volume) {
  const auto* tracked = std::get_if<TrackedSweep>(&volume.geometry.motion);
  if (tracked == nullptr || tracked->frame_times_s.empty()) return 0.0;
  return tracked->frame_times_s.back() - tracked->frame_times_s.front();
}

PreScanVolume read_prescan_file(const UltrasoundSource& source,
                                std::vector<std::string>& warnings) {
  UltrasoundInput input = read_ultrasound(source);
  warnings.insert(warnings.end(), input.warnings.begin(), input.warnings.end());
  auto* volume = std::get_if<PreScanVolume>(&input.data);
  if (volume == nullptr)
    throw InputError(source.path.string(),
                     std::holds_alternative<TrackedImages>(input.data)
                         ? "holds B-mode images, must hold beams: probe, samples, "
                           "image_origin_px and image_spacing_mm resample them along beams"
                         : "holds a Cartesian volume, must hold beams before scan conversion");
  return std::move(*volume);
}

msg::PreScanVolumePtr stamped_message(const PreScanVolume& volume, const std::string& frame_id,
                                      FileStamp stamp, const ::ros::Time& now,
                                      const std::string& source) {
  std_msgs::Header header;
  header.frame_id = frame_id;
  header.stamp = stamp_of(volume, stamp, now, source);
  require_not_ahead(header.stamp, now, source, "acquisition_time");
  return boost::make_shared<msg::PreScanVolume>(to_message(volume, header));
}

}  // namespace usct::ros_interface
