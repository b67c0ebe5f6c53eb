#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <us_ct_registration/CtInfo.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/GetCt.h>
#include <us_ct_registration/LoadCt.h>
#include <us_ct_registration/SetCtRoi.h>
#include <us_ct_registration/StatusCode.h>

#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "ros/node/data_root.h"
#include "ros/node/parameters.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/volumes/label_table.h"
#include "us_ct_registration/rendering/surface.h"

namespace usct::ros_interface {

/// Holds the CT and publishes it, its surfaces and a summary. docs/nodes/ct_server.md.
class CtServer {
 public:
  CtServer(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  /// A CT as it was read, before anything of it is published.
  struct Loaded {
    LoadedCt ct;
    std::map<int, Surface> surfaces;
    bool has_labels = false;
  };

  struct BeingLoaded {
    std::string path;  // as it was given
    ::ros::WallTime since;
  };
  /// While it lives, diagnostics tell that a CT is being loaded: nobody could know else why there
  /// is none yet.
  class Told {
   public:
    Told(CtServer& server, const std::string& path);
    ~Told();
    Told(const Told&) = delete;
    Told& operator=(const Told&) = delete;

   private:
    CtServer& server_;
  };

  bool on_load(us_ct_registration::LoadCt::Request& request,
               us_ct_registration::LoadCt::Response& response);
  bool on_roi(us_ct_registration::SetCtRoi::Request& request,
              us_ct_registration::SetCtRoi::Response& response);
  bool on_get(us_ct_registration::GetCt::Request& request,
              us_ct_registration::GetCt::Response& response);
  /// Replaces the CT that is held. On failure the held CT stays, and the answer gives the reason.
  us_ct_registration::StatusCode load(const std::string& path, const std::string& labels);
  Loaded read(const std::string& path, const std::string& labels,
              const CtSelection& selection) const;
  LabelVolume read_labels(const std::string& labels, const Grid& ct_grid) const;
  CtSelection selection();
  std::filesystem::path resolve(const std::string& given, const std::string& field) const;
  /// The revision is the time in seconds since 1970, so that it rises across restarts without being
  /// stored.
  std::uint32_t next_revision();
  void hold(const Loaded& loaded);
  /// Writes what is held into the node's parameters. roslaunch starts a node that has ended again
  /// with the parameters of the master: it must not go back to the CT of the launch.
  void keep_over_respawn(const std::string& path, const std::string& labels,
                         const CtSelection& selected);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  ::ros::NodeHandle private_node_;
  std::string ct_frame_;
  std::optional<DataRoot> data_root_;
  DicomReadOptions dicom_options_;
  LabelTable label_table_;
  double surface_hu_ = 0.0;
  std::size_t surface_triangles_ = 0;

  std::mutex loading_;  // held while files are read
  std::uint32_t last_revision_ = ::ros::WallTime::now().sec;
  std::mutex mutex_;  // guards the members below; never held while files are read
  CtSelection selection_;
  std::string part_;  // of what the CT that is held is a part; empty: it is whole
  us_ct_registration::CtVolumeConstPtr volume_;
  us_ct_registration::CtInfo info_;
  std::string last_error_;
  std::optional<BeingLoaded> being_loaded_;

  ::ros::Publisher volume_publisher_;
  ::ros::Publisher info_publisher_;
  ::ros::Publisher surface_publisher_;
  ::ros::Publisher points_publisher_;
  ::ros::Publisher mesh_publisher_;
  ::ros::ServiceServer load_server_;
  ::ros::ServiceServer roi_server_;
  ::ros::ServiceServer get_server_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer diagnostics_timer_;
  ::ros::WallTimer first_load_timer_;
};

}  // namespace usct::ros_interface
