#include "ros/ingest/file_source.h"

#include <ros/console.h>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

us_ct_registration::PreScanVolumePtr read(const UltrasoundSource& source,
                                          const FileOptions& options) {
  std::vector<std::string> warnings;
  const auto volume =
      read_volume_message(source, options.frame_id, options.stamp, ::ros::Time::now(), warnings);
  for (const std::string& warning : warnings) ROS_WARN("%s", warning.c_str());
  return volume;
}

}  // namespace

void publish_file(const std::filesystem::path& path, const FileOptions& options,
                  const PublishVolume& publish) {
  UltrasoundSource source = options.ultrasound;
  source.path = path;
  us_ct_registration::PreScanVolumePtr volume;
  try {
    volume = read(source, options);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {  // memory, disk, a stamp before 1970
    throw std::runtime_error(path.string() + ": " + error.what());
  }
  publish(volume);
}

FileSource::FileSource(const FileOptions& options, const PublishVolume& publish) {
  publish_file(options.ultrasound.path, options, publish);
}

}  // namespace usct::ros_interface
