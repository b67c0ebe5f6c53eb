#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "ros/conversions/surface_markers.h"
#include "ros/overlay/newest_slot.h"
#include "ros/overlay/overlay_scene.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

Surface tetrahedron() {
  Surface surface;
  surface.points_mm = {{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {0, 0, 10}};
  surface.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return surface;
}

msg::Alignment accepted() {
  msg::Alignment alignment;
  alignment.state = msg::Alignment::ACCEPTED;
  alignment.header.frame_id = "patient";
  alignment.header.stamp = ::ros::Time(1000);
  alignment.ct_frame = "ct";
  alignment.transform.rotation.w = 1.0;
  alignment.transform.translation.x = 0.25;
  alignment.result_id = 5;
  alignment.ct_crc32 = 77;
  alignment.expected_error = 0.002;
  return alignment;
}

OverlaySceneOptions with_band() {
  OverlaySceneOptions options;
  options.styles["tumour"].has_band = true;
  options.styles["vein"].is_visible = false;
  return options;
}

/// A keeper of three structures and an accepted alignment.
struct KeptOverlay {
  OverlaySceneKeeper keeper{with_band()};
  KeptOverlay() {
    keeper.take_surface(
        to_markers({{1, tetrahedron()}, {2, tetrahedron()}, {3, tetrahedron()}},
                   {{1, {"left kidney", {}}}, {2, {"tumour", {}}}, {3, {"vein", {}}}}, "ct", 77));
    msg::CtInfo info;
    info.crc32 = 77;
    keeper.take_info(info);
    keeper.take_alignment(accepted());
  }
};

TEST(OverlayScene, HasTheVisibleStructuresWhereTheAlignmentHasThem) {
  const KeptOverlay kept;
  const OverlayScene scene = kept.keeper.at(::ros::Time(1060));
  EXPECT_EQ(scene.refusal, "");
  EXPECT_TRUE(scene.warnings.empty());
  EXPECT_EQ(scene.fixed_frame, "patient");
  EXPECT_EQ(scene.T_fixed_ct.translation().x(), 250.0);
  EXPECT_DOUBLE_EQ(scene.age_s, 60.0);
  ASSERT_EQ(scene.structures.size(), 2U);
  EXPECT_EQ(scene.structures[0].name, "left kidney");
  EXPECT_FALSE(scene.structures[0].bound_mm);
  // Without a covariance: 1.5 times the expected error.
  EXPECT_DOUBLE_EQ(scene.structures[1].bound_mm.value(), 3.0);
  // Corners that triangles share are one point, in millimetres.
  EXPECT_EQ(scene.structures[0].surface->points_mm.size(), 4U);
  EXPECT_EQ(scene.structures[0].surface->triangles.size(), 4U);
  EXPECT_EQ(scene.structures[0].surface->points_mm[1].cwiseAbs().maxCoeff(), 10.0);
  EXPECT_EQ(kept.keeper.misnamed(), "");
}

/// The summary of the CT comes before its surfaces, which may still be those of another one.
TEST(OverlayScene, SurfacesThatSayTheyAreOfAnotherCtAreNotDrawn) {
  KeptOverlay kept;
  const auto refusal_with = [&](const visualization_msgs::MarkerArray& surfaces) {
    kept.keeper.take_surface(surfaces);
    return kept.keeper.at(::ros::Time(1060)).refusal;
  };
  const LabelTable labels{{1, {"tumour", {}}}};
  EXPECT_THAT(refusal_with(to_markers({{1, tetrahedron()}}, labels, "ct", 78)),
              HasSubstr("the surfaces are of another CT"));
  EXPECT_EQ(refusal_with(to_markers({{1, tetrahedron()}}, labels, "ct", 77)), "");
  EXPECT_EQ(kept.keeper.at(::ros::Time(1060)).ct_crc32, 77U);
  // Those of another node may not say it; the summary of the CT then counts alone.
  visualization_msgs::MarkerArray unnamed = to_markers({{1, tetrahedron()}}, labels, "ct", 77);
  unnamed.markers.erase(unnamed.markers.begin());
  EXPECT_EQ(refusal_with(unnamed), "");
}

TEST(OverlayScene, SurfacesInAnotherFrameThanThatOfTheCtAreNotDrawn) {
  KeptOverlay kept;
  kept.keeper.take_surface(to_markers({{1, tetrahedron()}}, {{1, {"tumour", {}}}}, "patient", 77));
  EXPECT_THAT(kept.keeper.at(::ros::Time(1060)).refusal,
              HasSubstr("the surface 'tumour' is in the frame 'patient', must be in that of the "
                        "CT, 'ct'"));
}

TEST(OverlayScene, SurfacesThatAreRefusedLeaveNoneBehind) {
  KeptOverlay kept;
  visualization_msgs::MarkerArray broken =
      to_markers({{1, tetrahedron()}}, {{1, {"tumour", {}}}}, "ct", 77);
  broken.markers.back().points.pop_back();
  EXPECT_THROW(kept.keeper.take_surface(broken), InputError);
  EXPECT_EQ(kept.keeper.at(::ros::Time(1060)).refusal, "no surfaces of the CT");
}

TEST(OverlayScene, IsOutdatedByEveryChangeOfTheAlignment) {
  KeptOverlay kept;
  const OverlayScene scene = kept.keeper.at(::ros::Time(1060));
  EXPECT_TRUE(kept.keeper.is_current(scene));
  msg::Alignment other = accepted();
  other.result_id = 6;
  kept.keeper.take_alignment(other);
  EXPECT_FALSE(kept.keeper.is_current(scene));
  other = accepted();
  other.transform.translation.x = 0.2501;
  kept.keeper.take_alignment(other);
  EXPECT_FALSE(kept.keeper.is_current(scene));
  other = accepted();
  other.header.frame_id = "table";
  kept.keeper.take_alignment(other);
  EXPECT_FALSE(kept.keeper.is_current(scene));
  other = accepted();
  other.waiting_id = 9;  // another result waits; this one still counts
  kept.keeper.take_alignment(other);
  EXPECT_TRUE(kept.keeper.is_current(scene));
  kept.keeper.take_alignment({});
  EXPECT_FALSE(kept.keeper.is_current(scene));
  kept.keeper.take_alignment(accepted());
  kept.keeper.take_info({});
  EXPECT_FALSE(kept.keeper.is_current(scene));
}

TEST(OverlayScene, APoseThatIsNotRigidIsRefused) {
  KeptOverlay kept;
  msg::Alignment broken = accepted();
  broken.transform.rotation.w = 0.5;
  kept.keeper.take_alignment(broken);
  EXPECT_NE(kept.keeper.at(::ros::Time(1060)).refusal, "");
}

/// 3 mm along x; the points reach 10 mm from the origin, where a rotation of 0.1 rad about each
/// axis gives 0.1 * 10 * sqrt(2).
TEST(OverlayScene, TheBoundIsThatOfTheCovarianceAtTheStructure) {
  KeptOverlay kept;
  geometry_msgs::PoseWithCovarianceStamped pose;
  pose.header = accepted().header;
  pose.pose.covariance[0] = 0.003 * 0.003;
  for (const std::size_t axis : {21U, 28U, 35U}) pose.pose.covariance[axis] = 0.1 * 0.1;
  kept.keeper.take_pose(pose);
  const OverlayScene scene = kept.keeper.at(::ros::Time(1060));
  EXPECT_NEAR(scene.structures[1].bound_mm.value(), 1.5 * std::sqrt(9.0 + 2.0), 1e-9);
  // The pose of another alignment says nothing of this one.
  for (const bool is_other_stamp : {true, false}) {
    pose.header = accepted().header;
    if (is_other_stamp)
      pose.header.stamp = ::ros::Time(900);
    else
      pose.header.frame_id = "table";
    kept.keeper.take_pose(pose);
    EXPECT_DOUBLE_EQ(kept.keeper.at(::ros::Time(1060)).structures[1].bound_mm.value(), 3.0);
  }
}

/// The CT is turned by 90 degrees about z, so that the tetrahedron's corners lie at 10 mm along y,
/// -x and z of the fixed frame. A rotation w about y moves the one along z by 10 mm w along x, and
/// the one along -x by 10 mm w along z; a shift along x that goes with it (correlation 1) adds to
/// the first of these motions.
TEST(OverlayScene, TheBoundIsThatOfShiftAndRotationTogetherWhereTheStructureIs) {
  KeptOverlay kept;
  msg::Alignment turned = accepted();
  turned.transform.rotation.z = turned.transform.rotation.w = std::sqrt(0.5);
  kept.keeper.take_alignment(turned);
  geometry_msgs::PoseWithCovarianceStamped pose;
  pose.header = turned.header;
  // The bound with a shift of 3 mm along x (0) or z (2), and the rotation.
  const auto bound_mm = [&](int axis) {
    constexpr int kAboutY = 4;
    const double t_m = 0.003;
    const double w = 0.2;
    pose.pose.covariance = {};
    pose.pose.covariance[7 * axis] = t_m * t_m;
    pose.pose.covariance[7 * kAboutY] = w * w;
    pose.pose.covariance[6 * axis + kAboutY] = pose.pose.covariance[6 * kAboutY + axis] = t_m * w;
    kept.keeper.take_pose(pose);
    return kept.keeper.at(::ros::Time(1060)).structures[1].bound_mm.value();
  };
  EXPECT_NEAR(bound_mm(0), 1.5 * (3.0 + 2.0), 1e-9);
  // A shift along z instead adds to the motion of the corner along -x.
  EXPECT_NEAR(bound_mm(2), 1.5 * (3.0 + 2.0), 1e-9);
}

TEST(OverlayScene, MarkersMayHavePosesOfTheirOwn) {
  KeptOverlay kept;
  visualization_msgs::MarkerArray surfaces =
      to_markers({{1, tetrahedron()}}, {{1, {"tumour", {}}}}, "ct", 77);
  surfaces.markers.back().pose.position.y = 0.5;
  surfaces.markers.back().pose.orientation.w = surfaces.markers.back().pose.orientation.z =
      std::sqrt(0.5);
  kept.keeper.take_surface(surfaces);
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p_mm :
       kept.keeper.at(::ros::Time(1060)).structures.at(0).surface->points_mm)
    box.extend(p_mm);
  EXPECT_TRUE(box.min().isApprox(Eigen::Vector3d(-10.0, 500.0, 0.0), 1e-9));
  EXPECT_TRUE(box.max().isApprox(Eigen::Vector3d(0.0, 510.0, 10.0), 1e-9));
}

TEST(OverlayScene, SaysWhatAPersonMustKnowOfTheAlignment) {
  KeptOverlay kept;
  const auto warnings = [&] { return kept.keeper.at(::ros::Time(1060)).warnings; };
  msg::RegistrationResult result;
  result.status.code = msg::StatusCode::CANCELLED;
  result.status.message = "cancelled by the caller";
  kept.keeper.take_result(result);
  EXPECT_TRUE(warnings().empty()) << "the alignment is as good as before";
  result.status.code = msg::StatusCode::LOW_CONFIDENCE;
  result.status.message = "too dark";
  kept.keeper.take_result(result);
  EXPECT_THAT(warnings(), testing::ElementsAre(HasSubstr("REFUSED: the last registration: too")));
  result.status.code = msg::StatusCode::CANCELLED;
  kept.keeper.take_result(result);
  EXPECT_EQ(warnings().size(), 1U) << "the refusal before is still the last word";
  // Where nothing is drawn, the reason alone would hide that a registration was tried.
  kept.keeper.take_alignment({});
  EXPECT_THAT(warnings(), testing::ElementsAre(HasSubstr("REFUSED")));
  result.status.code = msg::StatusCode::REGISTERED;
  kept.keeper.take_result(result);
  EXPECT_TRUE(warnings().empty());
  msg::Alignment restored = accepted();
  restored.state = msg::Alignment::RESTORED;
  restored.waiting_id = 9;
  kept.keeper.take_alignment(restored);
  EXPECT_THAT(warnings(), testing::ElementsAre(HasSubstr("RESTORED"), HasSubstr("WAITING")));
}

TEST(OverlayScene, SaysThatTheStructureWithABandIsNotThere) {
  KeptOverlay kept;
  kept.keeper.take_surface(to_markers({{1, tetrahedron()}}, {}, "ct", 77));  // without names
  EXPECT_THAT(kept.keeper.at(::ros::Time(1060)).warnings,
              testing::ElementsAre(HasSubstr("NO BAND: ct/surface has no 'tumour'")));
}

TEST(NewestSlot, OnlyTheNewestValueWaits) {
  NewestSlot<int> slot;
  slot.put(1);
  slot.put(2);
  slot.put(3);
  EXPECT_EQ(slot.take(), 3);
  EXPECT_EQ(slot.dropped(), 2U);
  std::optional<int> taken = 0;
  std::thread waiting([&] { taken = slot.take(); });
  slot.close();
  waiting.join();
  EXPECT_EQ(taken, std::nullopt);
}

}  // namespace
}  // namespace usct::ros_interface
