#include "ros/ingest/file_source.h"

#include <ros/console.h>

#include "ros/data_root.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
void publish_file(const std::filesystem::path& path, const std::string& shown_as,
                  const FileOptions& options, const PublishVolume& publish) {
  UltrasoundSource source = options.ultrasound;
  source.path = path;
  us_ct_registration::PreScanVolumePtr volume;
  std::vector<std::string> warnings;
  try {
    volume =
        read_volume_message(source, options.frame_id, options.stamp, ::ros::Time::now(), warnings);
  } catch (const InputError& error) {
    throw std::runtime_error(without_names(error.what(), path, shown_as));
  } catch (const std::exception& error) {  // memory, disk, a stamp before 1970
    throw std::runtime_error(shown_as + ": " + without_names(error.what(), path, shown_as));
  }
  for (const std::string& warning : warnings)
    ROS_WARN("%s", without_names(warning, path, shown_as).c_str());
  publish(volume);
}

FileSource::FileSource(const FileOptions& options, const PublishVolume& publish) {
  publish_file(options.ultrasound.path, options.ultrasound.path.string(), options, publish);
}

}  // namespace usct::ros_interface
