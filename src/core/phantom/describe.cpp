#include <nlohmann/json.hpp>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {
namespace {

using Json = nlohmann::ordered_json;

Json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json pose_json(const Eigen::Isometry3d& T) {
  Json rows = Json::array();
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) rows.push_back(T.matrix()(r, c));
  return rows;
}

template <typename T>
Json optional_json(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json anatomy_json(const AnatomyOptions& o) {
  return {{"contrast", o.contrast},
          {"tissue_variation", o.tissue_variation},
          {"bubbles", o.bubbles},
          {"ball_diameter_mm", o.ball_diameter_mm},
          {"standoff_mm", optional_json(o.standoff_mm)},
          {"indentation_mm", optional_json(o.indentation_mm)},
          {"deformation_mm", o.deformation_mm},
          {"tumour", o.tumour},
          {"cyst", o.cyst},
          {"stone", o.stone}};
}

Json ct_json(const CtOptions& o) {
  return {{"size", {o.size.x(), o.size.y(), o.size.z()}},
          {"spacing_mm", vector_json(o.spacing_mm)},
          {"axes", o.axes},
          {"oblique_deg", vector_json(o.oblique_deg)},
          {"noise_hu", o.noise_hu},
          {"in_plane_fwhm_mm", o.in_plane_fwhm_mm},
          {"slice_fwhm_mm", o.slice_fwhm_mm}};
}

Json sweep_json(const SweepOptions& o) {
  return {{"kind", to_string(o.kind)},
          {"samples", o.samples},
          {"lines", o.lines},
          {"frames", o.frames},
          {"depth_mm", optional_json(o.depth_mm)},
          {"start_depth_mm", o.start_depth_mm},
          {"probe_radius_mm", optional_json(o.probe_radius_mm)},
          {"motor_radius_mm", o.motor_radius_mm},
          {"lateral_fov_deg", optional_json(o.lateral_fov_deg)},
          {"linear_width_mm", o.linear_width_mm},
          {"elevation_fov_deg", optional_json(o.elevation_fov_deg)},
          {"frame_travel_deg", o.frame_travel_deg},
          {"sweep_length_mm", o.sweep_length_mm},
          {"frame_rate_hz", o.frame_rate_hz},
          {"sweep_error", o.sweep_error},
          {"pose_noise_mm", o.pose_noise_mm},
          {"pose_noise_deg", o.pose_noise_deg},
          {"lag_s", o.lag_s},
          {"duplicate_fraction", o.duplicate_fraction},
          {"breathing_mm", o.breathing_mm},
          {"breathing_period_s", o.breathing_period_s},
          {"sweep_duration_s", optional_json(o.sweep_duration_s)}};
}

Json ultrasound_json(const UltrasoundOptions& o) {
  return {{"frequency_mhz", optional_json(o.frequency_mhz)},
          {"pulse_cycles", o.pulse_cycles},
          {"aperture_mm", o.aperture_mm},
          {"f_number", o.f_number},
          {"transmit_focus_mm", optional_json(o.transmit_focus_mm)},
          {"elevation_aperture_mm", o.elevation_aperture_mm},
          {"elevation_focus_mm", o.elevation_focus_mm},
          {"dynamic_range_db", o.dynamic_range_db},
          {"cortex_grey", o.cortex_grey},
          {"penetration_mm", o.penetration_mm},
          {"time_gain_compensation", o.time_gain_compensation},
          {"tgc_error_db", o.tgc_error_db},
          {"lateral_gain_error_db", o.lateral_gain_error_db},
          {"frame_gain_error_db", o.frame_gain_error_db},
          {"edge_loss_db", o.edge_loss_db},
          {"clutter_db", o.clutter_db},
          {"near_field_db", o.near_field_db},
          {"specular", o.specular},
          {"reverberation", o.reverberation},
          {"no_contact_lines", o.no_contact_lines},
          {"sound_speed_error", o.sound_speed_error},
          {"tissue_speeds", o.tissue_speeds},
          {"echo_texture_db", o.echo_texture_db},
          {"edge_shadows", o.edge_shadows}};
}

const char* tissue_name(Tissue tissue) {
  static const TissueTable table = TissueTable::patient();
  return table[tissue].name;
}

Json from_ct_json(const FromCtOptions& o) {
  Json labels = Json::object();
  for (const auto& [label, tissue] : o.tissue_of_label)
    labels[std::to_string(label)] = tissue_name(tissue);
  return {
      {"tissue_of_label", labels},
      {"kidney_label", optional_json(o.kidney_label)},
      {"kidney_centre_mm", o.kidney_centre_mm ? vector_json(*o.kidney_centre_mm) : Json(nullptr)},
      {"approach", to_string(o.approach)},
      {"bone_hu", o.bone_hu},
      {"added_noise_hu", o.added_noise_hu}};
}

Json options_json(const PhantomOptions& o) {
  Json json = {{"anatomy", anatomy_json(o.anatomy)},
               {"sweep", sweep_json(o.sweep)},
               {"ultrasound", ultrasound_json(o.ultrasound)}};
  if (o.scene == SceneKind::kFromCt)
    json["from_ct"] = from_ct_json(o.from_ct);
  else
    json["ct"] = ct_json(o.ct);
  return json;
}

Json true_geometry_json(const PhantomTruth& truth) {
  Json json;
  if (const auto* motor = std::get_if<MotorSweep>(&truth.geometry.motion)) {
    Json angles = Json::array();
    for (const double angle : motor->frame_angles_rad) angles.push_back(angle / kDegree);
    json["frame_angles_deg"] = angles;
    return json;
  }
  const auto& tracked = std::get<TrackedSweep>(truth.geometry.motion);
  json["T_us_frame"] = Json::array();
  for (const Eigen::Isometry3d& T : tracked.T_us_frame) json["T_us_frame"].push_back(pose_json(T));
  json["image_of_frame"] = truth.image_of_frame;
  return json;
}

Json points_json(const std::vector<Eigen::Vector3d>& points) {
  Json json = Json::array();
  for (const Eigen::Vector3d& p : points) json.push_back(vector_json(p));
  return json;
}

}  // namespace

std::string describe_json(const PhantomCase& phantom) {
  const PhantomTruth& truth = phantom.truth;
  Json json;
  json["version"] = USCT_VERSION;
  json["scene"] = to_string(phantom.options.scene);
  json["seed"] = phantom.options.seed;
  json["options"] = options_json(phantom.options);
  json["truth"] = {
      {"T_us_ct", pose_json(truth.T_us_ct)},
      {"meaning",
       "physical: best rigid fit of the kidney's surface from CT to where it was during the "
       "ultrasound (with breathing: its mean over the frames that cut it); errors of sound speed, "
       "motor, poses and lag are not part of it"},
      {"rms_residual_mm", truth.rms_residual_mm},
      {"max_residual_mm", truth.max_residual_mm},
      {"fiducials_ct_mm", points_json(truth.fiducials_ct_mm)},
      {"fiducials_us_mm", points_json(truth.fiducials_us_mm)},
      {"geometry", true_geometry_json(truth)}};
  if (phantom.options.sweep.breathing_mm > 0.0) json["truth"]["breathing_mm"] = truth.breathing_mm;
  json["labels"] = Json::object();
  for (int t = 0; t < kTissueCount; ++t)
    json["labels"][std::to_string(t)] = tissue_name(static_cast<Tissue>(t));
  return json.dump(1);
}

}  // namespace usct::phantom
