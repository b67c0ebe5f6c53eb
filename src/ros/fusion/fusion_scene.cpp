#include "ros/fusion/fusion_scene.h"

#include <us_ct_registration/DecideRequest.h>
#include <us_ct_registration/StatusCode.h>

#include "ros/alignment/known_results.h"
#include "ros/conversions/alignment.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/registration_result.h"
#include "ros/conversions/surface_markers.h"
#include "ros/conversions/times.h"
#include "ros/node/refusal.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/confidence_text.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using Eigen::Vector3d;

bool is_same(const std_msgs::Header& a, const std_msgs::Header& b) {
  return a.stamp == b.stamp && a.frame_id == b.frame_id;
}

std::string name_of(const msg::Alignment& message) {
  return message.result_id == 0 ? "the alignment from before the restart"
                                : "result " + std::to_string(message.result_id);
}

/// The headline of a pose that is not drawn in favour of another one, or nothing.
std::string aside(const std::string& what, const std::string& why_not) {
  return why_not.empty() ? "" : " (" + what + " is not drawn: " + why_not + ")";
}

}  // namespace

std::set<std::string> fusion_mode_names() {
  std::set<std::string> names;
  for (const auto& [mode, name] : words_of(FusionMode{})) names.insert(name);
  return names;
}

std::optional<FusionMode> fusion_mode_named(const std::string& name) {
  for (const auto& [mode, its_name] : words_of(FusionMode{}))
    if (name == its_name) return mode;
  return std::nullopt;
}

FusionSceneKeeper::FusionSceneKeeper(FusionSceneOptions options)
    : options_(std::move(options)), mode_(options_.mode) {}

void FusionSceneKeeper::take_alignment(const msg::Alignment& message) {
  alignment_ = message;
  alignment_watch_.arrived(message);
}

void FusionSceneKeeper::take_result(const msg::RegistrationResult& message) {
  // A person cancelled it and knows it; what was shown before is as good as it was.
  if (message.status.code == msg::StatusCode::CANCELLED) return;
  Known taken{message.header, message.ct_crc32, message.id,
              registration_result_from(message, "registration/result")};
  taken.us.stamp = message.us_stamp;
  last_ = taken;
  results_[message.id] = std::move(taken);
  forget_old(results_, {alignment_.result_id, proposed_.result_id});
}

void FusionSceneKeeper::take_surface(const visualization_msgs::MarkerArray& message) {
  using visualization_msgs::Marker;
  std::vector<Vector3d> middles;
  for (const Marker& marker : message.markers)
    if (marker.action == Marker::ADD && !marker.points.empty() && !options_.centre_label.empty() &&
        marker.ns.find(options_.centre_label) != std::string::npos)
      middles.push_back(box_mm(marker, "ct/surface").center());
  label_middles_ct_mm_ = std::move(middles);
}

const FusionSceneKeeper::Known* FusionSceneKeeper::known(std::uint64_t id) const {
  const auto found = results_.find(id);
  return id == 0 || found == results_.end() ? nullptr : &found->second;
}

FusionSceneKeeper::Attempt FusionSceneKeeper::pose_by(const msg::Alignment& message,
                                                      const FusionUltrasound& us,
                                                      const FusionCt& ct) const try {
  if (message.ct_crc32 != ct.crc32) return {std::nullopt, "it is of another CT"};
  if (message.header.stamp != us.header.stamp)
    return {std::nullopt,
            "it is of another ultrasound, that of " + seconds_text(message.header.stamp) + " s"};
  // The result says where the CT is in the ultrasound itself, whatever tf still knows of the time.
  if (const Known* result = known(message.result_id))
    if (result->result.T_us_ct && result->ct_crc32 == ct.crc32 && is_same(result->us, us.header))
      return {result->result.T_us_ct, ""};
  const Isometry3d T_fixed_ct = T_fixed_ct_from(message).value();
  if (message.header.frame_id == us.header.frame_id) return {T_fixed_ct, ""};
  if (message.header.frame_id != us.fixed_frame || !us.T_fixed_us)
    return {std::nullopt, "the pose of '" + us.header.frame_id + "' in '" +
                              message.header.frame_id + "' at the ultrasound's stamp is not known"};
  return {us.T_fixed_us->inverse() * T_fixed_ct, ""};
} catch (const InputError& error) {
  return {std::nullopt, error.what()};
}

std::string FusionSceneKeeper::evidence(const msg::Alignment& message) const {
  const Known* result = known(message.result_id);
  return evidence_of(message, result == nullptr ? nullptr : &result->result);
}

std::optional<FusionPose> FusionSceneKeeper::refused_pose(const FusionUltrasound& us,
                                                          const FusionCt& ct) const {
  if (!last_ || last_->result.T_us_ct || last_->result.candidates.empty() ||
      last_->ct_crc32 != ct.crc32 || !is_same(last_->us, us.header))
    return std::nullopt;
  return FusionPose{
      PoseStanding::kRefused, last_->result.candidates.front().T_us_ct,
      "REFUSED: this is the best candidate and NOT a registration. " + last_->result.message,
      confidence_text(last_->result)};
}

FusionPose FusionSceneKeeper::pose_of(const FusionUltrasound& us, const FusionCt* ct) const {
  FusionPose none{PoseStanding::kNone, std::nullopt, "NO POSE: ", us.warning};
  if (ct == nullptr) {
    none.headline += "no CT has arrived";
    return none;
  }
  const std::string warning = us.warning.empty() ? "" : us.warning + "\n";
  std::string asides;
  if (proposed_.state == msg::Alignment::PROPOSED) {
    const Attempt waiting = pose_by(proposed_, us, *ct);
    const std::string id =
        std::to_string(proposed_.result_id != 0 ? proposed_.result_id : +msg::DecideRequest::KEPT);
    if (waiting.T_us_ct)
      return {PoseStanding::kWaiting, waiting.T_us_ct,
              "WAITING for a decision: " + name_of(proposed_) + ". To accept: rosservice call " +
                  options_.accept_service + " " + id + ". To reject: rosservice call " +
                  options_.reject_service + " " + id,
              warning + evidence(proposed_)};
    asides += aside(name_of(proposed_) + ", which waits for a decision,", waiting.why_not);
  }
  const std::optional<FusionPose> refused = refused_pose(us, *ct);
  const std::string& problem = alignment_problem();
  if (alignment_.state != msg::Alignment::NONE && problem.empty()) {
    const Attempt accepted = pose_by(alignment_, us, *ct);
    const bool is_restored = alignment_.state == msg::Alignment::RESTORED;
    if (accepted.T_us_ct)
      return {PoseStanding::kAccepted, accepted.T_us_ct,
              (is_restored ? "ACCEPTED before a restart: the patient may have moved since"
                           : "ACCEPTED: " + name_of(alignment_)) +
                  asides + (refused ? " (a later registration was REFUSED)" : ""),
              warning + evidence(alignment_)};
    asides += aside("the accepted alignment", accepted.why_not);
  }
  if (refused) {
    FusionPose pose = *refused;
    pose.headline += asides + (problem.empty() ? "" : " (" + problem + ")");
    pose.evidence = warning + pose.evidence;
    return pose;
  }
  const std::string& reason = problem.empty() ? alignment_.message : problem;
  none.headline += (reason.empty() ? "nothing is accepted" : reason) + asides;
  return none;
}

std::vector<Vector3d> FusionSceneKeeper::centres_us_mm(const FusionPose& pose) const {
  std::vector<Vector3d> centres;
  if (centre_ && centre_->frame == us_->header.frame_id)
    centres.push_back(centre_->p_mm);
  else if (centre_ && centre_->frame == us_->fixed_frame && us_->T_fixed_us)
    centres.push_back(us_->T_fixed_us->inverse() * centre_->p_mm);
  if (options_.centre_us_mm) centres.push_back(*options_.centre_us_mm);
  if (pose.T_us_ct)
    for (const Vector3d& middle_ct : label_middles_ct_mm_)
      centres.push_back(*pose.T_us_ct * middle_ct);
  return centres;
}

FusionScene FusionSceneKeeper::scene() const {
  FusionScene scene;
  if (!us_) return scene;
  scene.us = us_;
  scene.ct = ct_;
  scene.pose = pose_of(*us_, ct_.get());
  scene.mode = mode_;
  scene.centres_us_mm = centres_us_mm(scene.pose);
  return scene;
}

bool FusionSceneKeeper::is_current(const FusionScene& scene) const {
  const FusionPose now = pose_of(*scene.us, scene.ct.get());
  const bool is_same_pose = now.T_us_ct && scene.pose.T_us_ct
                                ? now.T_us_ct->matrix() == scene.pose.T_us_ct->matrix()
                                : !now.T_us_ct && !scene.pose.T_us_ct;
  return is_same_pose && now.standing == scene.pose.standing && now.headline == scene.pose.headline;
}

}  // namespace usct::ros_interface
