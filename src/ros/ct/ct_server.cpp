#include "ros/ct/ct_server.h"

#include <malloc.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <utility>

#include "ros/conversions/ct.h"
#include "ros/conversions/message_limit.h"
#include "ros/conversions/point_clouds.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/surface_markers.h"
#include "ros/conversions/times.h"
#include "ros/ct/ct_selection_parameters.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/status.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/subgrid.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;
namespace msg = us_ct_registration;
using Code = msg::StatusCode;

/// Gives free memory back to the system when it is destroyed. The heap of each thread would keep
/// what a load frees: after some loads, several times the memory of the CT.
struct MemoryReturned {
  ~MemoryReturned() { malloc_trim(0); }
};

/// An error of the core about a file, without names that callers may not be told.
InputError retold(const std::exception& error, const fs::path& path, const std::string& given) {
  const std::string text = without_names(error.what(), path, given);
  const std::string source = given + ": ";
  return {given, text.rfind(source, 0) == 0 ? text.substr(source.size()) : text};
}

/// A compressed file of some megabytes may announce more than the machine has.
constexpr std::uint64_t kMostStoredBytes = 4000000000;

std::string size_text(const Eigen::Vector3i& size) {
  return std::to_string(size.x()) + " x " + std::to_string(size.y()) + " x " +
         std::to_string(size.z());
}

/// What was left out of the CT, or nothing.
std::string part_text(const LoadedCt& ct) {
  const Eigen::Vector3i& whole = ct.whole_grid.size;
  return ct.volume.grid.size == whole ? "" : " of " + size_text(whole) + " (ct/roi)";
}

void require_sendable(const std::map<int, Surface>& surfaces, const std::string& labels) {
  constexpr std::size_t kTriangleBytes = 72;  // of ct/surface
  constexpr std::size_t kMostTriangles = kMostMessageBytes / kTriangleBytes;
  std::size_t triangles = 0;
  for (const auto& [label, surface] : surfaces) triangles += surface.triangles.size();
  if (triangles > kMostTriangles)
    throw InputError(labels, "its " + std::to_string(surfaces.size()) + " surfaces have " +
                                 std::to_string(triangles) + " triangles together, must have <= " +
                                 std::to_string(kMostTriangles) + ": set surface_triangles lower");
}

}  // namespace

CtServer::CtServer(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node),
      private_node_(private_node),
      diagnostics_(node, private_node, private_node.getNamespace()) {
  Parameters parameters(private_node);
  const std::string path = parameters.text("path", "");
  const std::string labels = parameters.text("labels", "");
  const std::string data_root = parameters.text("data_root", "");
  ct_frame_ = parameters.frame("ct_frame", "ct");
  dicom_options_.resample_irregular = parameters.flag("resample_irregular", false);
  const std::string label_table = parameters.text("label_table", "");
  surface_hu_ = parameters.number("surface_hu", 200.0, -1023.0, 32767.0);
  surface_triangles_ =
      static_cast<std::size_t>(parameters.whole("surface_triangles", 20000, 1000, 2000000));
  selection_ = read_selection(parameters, private_node);
  selection_.max_stored_bytes = kMostStoredBytes;
  selection_.max_kept_bytes = kMostMessageBytes;
  const double diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  if (ct_frame_.empty())
    throw InputError(private_node.resolveName("ct_frame"), "is empty, must name a frame");
  if (path.empty() && !labels.empty())
    throw InputError(private_node.resolveName("labels"), "is set, but 'path' is not");
  if (!label_table.empty()) {
    try {
      label_table_ = read_label_table(label_table);
    } catch (const InputError& error) {
      throw InputError(private_node.resolveName("label_table"), error.what());
    }
  }
  if (!data_root.empty()) data_root_.emplace(data_root, private_node.resolveName("data_root"));

  info_publisher_ = node_.advertise<msg::CtInfo>("ct/info", 1, true);
  volume_publisher_ = node_.advertise<msg::CtVolume>("ct/volume", 1, true);
  surface_publisher_ = node_.advertise<visualization_msgs::MarkerArray>("ct/surface", 1, true);
  points_publisher_ = node_.advertise<sensor_msgs::PointCloud2>("ct/surface_points", 1, true);
  mesh_publisher_ = node_.advertise<pcl_msgs::PolygonMesh>("ct/mesh", 1, true);
  load_server_ = node_.advertiseService("ct/load", &CtServer::on_load, this);
  roi_server_ = node_.advertiseService("ct/roi", &CtServer::on_roi, this);
  get_server_ = node_.advertiseService("ct/get_volume", &CtServer::on_get, this);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("CT", this, &CtServer::diagnose);
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
  // The constructor must not read the CT: it would block a nodelet's manager for seconds.
  if (!path.empty())
    first_load_timer_ = node_.createWallTimer(
        ::ros::WallDuration(0.001),
        guarded([this, path, labels](const ::ros::WallTimerEvent&) { load(path, labels); }), true);
}

fs::path CtServer::resolve(const std::string& given, const std::string& field) const {
  if (data_root_) return data_root_->resolve(given, field);
  // Without a data root, callers cannot choose files: the path is then that of the parameter.
  fs::path path(given);
  if (!path.is_absolute())
    throw InputError(given, "parameter '" + field + "' must be a whole path without data_root");
  return path;
}

LabelVolume CtServer::read_labels(const std::string& labels, const Grid& ct_grid) const {
  const fs::path path = resolve(labels, "labels");
  LabelVolume volume;
  try {
    const VolumeInfo info = read_volume_info(path);
    CtSelection all;
    all.max_stored_bytes = kMostStoredBytes;
    require_fits(all, info.grid, info.voxel_bytes, path.string());
    volume = read_volume<std::uint16_t>(path);
  } catch (const std::exception& error) {
    throw retold(error, path, labels);
  }
  if (!is_subgrid(volume.grid, ct_grid))
    throw InputError(labels, "its voxels (" + size_text(volume.grid.size) +
                                 ") are not those of the CT (" + size_text(ct_grid.size) +
                                 ") or part of them");
  return volume;
}

CtServer::Loaded CtServer::read(const std::string& path, const std::string& labels,
                                const CtSelection& selection) const {
  const fs::path ct_path = resolve(path, "path");
  Loaded loaded;
  try {
    loaded.ct = read_ct(ct_path, dicom_options_, {}, selection);
  } catch (const std::exception& error) {
    throw retold(error, ct_path, path);
  }
  for (std::string& warning : loaded.ct.warnings) warning = without_names(warning, ct_path, path);
  loaded.has_labels = !labels.empty();
  if (loaded.has_labels) {
    const LabelVolume volume = read_labels(labels, loaded.ct.whole_grid);
    loaded.surfaces = label_surfaces(volume, surface_triangles_);
    require_sendable(loaded.surfaces, labels);
    for (const std::string& warning :
         surface_warnings(volume, loaded.surfaces, surface_triangles_, label_table_))
      loaded.ct.warnings.push_back(warning);
  } else if (Surface surface = iso_surface(loaded.ct.volume, surface_hu_, surface_triangles_);
             !surface.triangles.empty()) {
    loaded.surfaces[0] = std::move(surface);
  }
  return loaded;
}

msg::StatusCode CtServer::load(const std::string& path, const std::string& labels) {
  const std::unique_lock<std::mutex> loading(loading_, std::try_to_lock);
  if (!loading) return status(Code::BUSY, "another CT is being loaded");
  const MemoryReturned at_end;
  const Told told(*this, path);
  msg::StatusCode answer;
  try {
    const CtSelection selected = selection();
    const Loaded loaded = read(path, labels, selected);
    for (const std::string& warning : loaded.ct.warnings) ROS_WARN("%s", warning.c_str());
    hold(loaded);
    keep_over_respawn(path, labels, selected);
    answer = status(Code::OK, loaded.ct.format + ", " + size_text(loaded.ct.volume.grid.size) +
                                  " voxels" + part_text(loaded.ct) + ", revision " +
                                  std::to_string(info_.revision));
    ROS_INFO("CT loaded: %s", answer.message.c_str());
    return answer;
  } catch (const PathRefused& error) {
    answer = status(Code::PATH_REFUSED, error.what());
  } catch (const InputError& error) {
    answer = status(Code::FILE_ERROR, error.what());
  } catch (const std::exception& error) {
    answer = status(Code::FAILED, error.what());
  }
  ROS_ERROR("CT not loaded: %s", answer.message.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  last_error_ = answer.message;
  return answer;
}

std::uint32_t CtServer::next_revision() {
  // There is at most one revision per second, and none in the second of the start, which a node
  // that ran before may have used.
  const double left_s = (::ros::WallTime(last_revision_ + 1, 0) - ::ros::WallTime::now()).toSec();
  ::ros::WallDuration(std::clamp(left_s, 0.0, 1.0)).sleep();
  // The clock may have been set back.
  last_revision_ = std::max(last_revision_ + 1, ::ros::WallTime::now().sec);
  return last_revision_;
}

void CtServer::hold(const Loaded& loaded) {
  const std::uint32_t revision = next_revision();
  std_msgs::Header header;
  header.stamp = valid_stamp(::ros::Time::now());
  header.frame_id = ct_frame_;
  const auto volume =
      boost::make_shared<const msg::CtVolume>(to_message(loaded.ct.volume, header, revision));
  msg::CtInfo info;
  info.header = header;
  info.revision = revision;
  info.crc32 = volume->crc32;
  info.size = volume->size;
  info.spacing = volume->spacing;
  const auto [lowest, highest] = std::minmax_element(volume->data.begin(), volume->data.end());
  info.lowest = *lowest;
  info.highest = *highest;
  info.format = loaded.ct.format;
  if (loaded.has_labels)
    for (const auto& [label, surface] : loaded.surfaces)
      info.labels.push_back(label_text(label, label_table_));
  // All is made before any of it counts.
  const LabelTable no_labels{{0, {"surface", std::nullopt}}};
  const auto surfaces = boost::make_shared<const visualization_msgs::MarkerArray>(to_markers(
      loaded.surfaces, loaded.has_labels ? label_table_ : no_labels, ct_frame_, volume->crc32));
  const sensor_msgs::PointCloud2 points = to_points(loaded.surfaces, ct_frame_);
  const pcl_msgs::PolygonMesh mesh = to_mesh(loaded.surfaces, ct_frame_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    volume_ = volume;
    info_ = info;
    part_ = part_text(loaded.ct);
    last_error_.clear();
  }
  // The summary is sent first, so that tf_publisher knows the CT before it gets a result for it.
  info_publisher_.publish(info);
  volume_publisher_.publish(volume);
  surface_publisher_.publish(surfaces);
  points_publisher_.publish(points);
  mesh_publisher_.publish(mesh);
}

void CtServer::keep_over_respawn(const std::string& path, const std::string& labels,
                                 const CtSelection& selected) {
  private_node_.setParam("path", path);
  private_node_.setParam("labels", labels);
  set_selection(selected, private_node_);
}

bool CtServer::on_load(msg::LoadCt::Request& request, msg::LoadCt::Response& response) {
  response.status = data_root_ ? load(request.path, request.labels)
                               : status(Code::PATH_REFUSED, "parameter data_root is not set");
  const std::lock_guard<std::mutex> lock(mutex_);
  response.revision = info_.revision;
  return true;
}

CtServer::Told::Told(CtServer& server, const std::string& path) : server_(server) {
  ROS_INFO("loading the CT %s", path.c_str());
  const std::lock_guard<std::mutex> lock(server_.mutex_);
  server_.being_loaded_ = {path, ::ros::WallTime::now()};
}

CtServer::Told::~Told() {
  const std::lock_guard<std::mutex> lock(server_.mutex_);
  server_.being_loaded_.reset();
}

CtSelection CtServer::selection() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return selection_;
}

bool CtServer::on_roi(msg::SetCtRoi::Request& request, msg::SetCtRoi::Response& response) {
  try {
    if (request.corners.size() != 0 && request.corners.size() != 2)
      throw InputError("'corners'", "has " + std::to_string(request.corners.size()) +
                                        " points, must have 2, or none for all of the CT");
    const std::lock_guard<std::mutex> lock(mutex_);
    CtSelection wanted = selection_;
    wanted.box_mm.reset();
    if (!request.corners.empty())
      wanted.box_mm = box_of(point_from_message_mm(request.corners[0]),
                             point_from_message_mm(request.corners[1]));
    constexpr std::uint32_t kTooMany = CtSelection::kMostDecimation + 1;
    wanted.decimation = static_cast<int>(std::clamp(request.decimation, 1U, kTooMany));
    wanted.validate();
    selection_ = wanted;
    response.status = status(Code::OK, "valid from the next load on");
  } catch (const InputError& error) {
    response.status = status(Code::INVALID_REQUEST, error.what());
  }
  return true;
}

bool CtServer::on_get(msg::GetCt::Request&, msg::GetCt::Response& response) {
  msg::CtVolumeConstPtr volume;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    volume = volume_;
  }
  if (volume == nullptr) {
    response.status = status(Code::NO_CT, "none was loaded");
    return true;
  }
  response.status = status(Code::OK, "revision " + std::to_string(volume->revision));
  response.volume = *volume;
  return true;
}

void CtServer::diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool has_ct = volume_ != nullptr;
  const std::string held = has_ct ? "CT is held" : "no CT is held";
  if (being_loaded_)
    diagnosis.summary(
        DiagnosticStatus::WARN,
        held + "; " + being_loaded_->path + " has been loading for " +
            formatted("%.0f", (::ros::WallTime::now() - being_loaded_->since).toSec()) + " s");
  else if (!last_error_.empty())
    diagnosis.summary(DiagnosticStatus::ERROR, last_error_);
  else
    diagnosis.summary(has_ct ? DiagnosticStatus::OK : DiagnosticStatus::WARN, held);
  diagnosis.add("revision", info_.revision);
  if (has_ct) {
    diagnosis.add("format", info_.format);
    diagnosis.add("voxels", std::to_string(info_.size[0]) + " x " + std::to_string(info_.size[1]) +
                                " x " + std::to_string(info_.size[2]) + part_);
    diagnosis.add("labels", info_.labels.size());
    diagnosis.add("loaded", stamp_and_age(info_.header.stamp, ::ros::Time::now()));
  }
  diagnosis.add("last error", last_error_);
}

}  // namespace usct::ros_interface
