#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "ros/conversions/surface_markers.h"
#include "ros/unit/two_surfaces.h"

namespace usct::ros_interface {
namespace {

using visualization_msgs::Marker;

TEST(CtSurface, MarkersReplaceThoseBeforeAndAreInMetres) {
  const auto array = to_markers(two_surfaces(), {{2, {"kidney", {}}}}, "ct", 3735928559U);
  EXPECT_EQ(ct_crc32_of(array), 3735928559U);
  EXPECT_EQ(ct_crc32_of({}), std::nullopt);
  ASSERT_EQ(array.markers.size(), 3U);
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
  const Marker& kidney = array.markers[1];
  EXPECT_EQ(kidney.type, Marker::TRIANGLE_LIST);
  EXPECT_EQ(kidney.header.frame_id, "ct");
  EXPECT_EQ(kidney.id, 2);
  EXPECT_EQ(kidney.ns, "2 kidney");
  EXPECT_EQ(array.markers[2].ns, "5 label");
  ASSERT_EQ(kidney.points.size(), 6U);
  EXPECT_DOUBLE_EQ(kidney.points[2].y, 2.0);
  EXPECT_DOUBLE_EQ(kidney.points[2].z, -0.5);
  EXPECT_DOUBLE_EQ(kidney.points[3].y, 2.0);
  EXPECT_EQ(kidney.color.a, 1.0F);
  EXPECT_NE(kidney.color, array.markers[2].color);
}

TEST(PlacedSurfaces, LieInTheFixedFrameWhereTheCtIs) {
  visualization_msgs::MarkerArray surfaces;
  surfaces.markers.resize(2);
  surfaces.markers[1].header.frame_id = "ct";
  surfaces.markers[1].color.r = 0.5F;
  const Eigen::Isometry3d T_patient_ct =
      Eigen::Translation3d(250.0, 0.0, 0.0) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ());
  const visualization_msgs::MarkerArray found = placed(surfaces, "patient", T_patient_ct, 0.5);
  ASSERT_EQ(found.markers.size(), 2u);
  EXPECT_EQ(found.markers[1].header.frame_id, "patient");
  EXPECT_EQ(found.markers[1].pose.position.x, 0.25);
  EXPECT_EQ(std::abs(found.markers[1].pose.orientation.z), 1.0);
  EXPECT_EQ(found.markers[1].color.a, 0.5F);
  EXPECT_EQ(found.markers[1].color.r, 0.5F);
  const visualization_msgs::MarkerArray none = placed(surfaces, "patient", std::nullopt, 0.5);
  ASSERT_EQ(none.markers.size(), 1u);
  EXPECT_EQ(none.markers[0].action, visualization_msgs::Marker::DELETEALL);
  EXPECT_EQ(none.markers[0].header.frame_id, "patient");
}

TEST(RefusedMarkers, AreRedAndSayWhyAndReplaceThoseBefore) {
  const auto surfaces = to_markers(two_surfaces(), {{2, {"kidney", {}}}}, "ct", 3735928559U);
  const Eigen::Isometry3d T_patient_ct(Eigen::Translation3d(250.0, 0.0, 0.0));
  const std::string reason =
      "the ultrasound fits the CT better with its lines in reverse order: check which way round "
      "the probe was held";
  const auto found =
      refused_markers(surfaces, {"patient", T_patient_ct, reason, {0, 0, 400}, {0, 0, -100}}, 0.5);
  ASSERT_EQ(found.markers.size(), 5u);
  EXPECT_EQ(found.markers[0].action, Marker::DELETEALL);
  EXPECT_EQ(found.markers[0].header.frame_id, "patient");
  for (std::size_t i = 1; i < 5; ++i) {
    const Marker& marker = found.markers[i];
    EXPECT_EQ(marker.ns, "REFUSED");
    EXPECT_EQ(marker.action, Marker::ADD);
    EXPECT_EQ(marker.header.frame_id, "patient");
    EXPECT_GT(marker.color.r, 0.9F);
    EXPECT_LT(marker.color.g + marker.color.b, 0.3F);
    for (std::size_t j = 1; j < i; ++j) EXPECT_NE(marker.id, found.markers[j].id);
  }
  EXPECT_EQ(found.markers[1].pose.position.x, 0.25);
  EXPECT_EQ(found.markers[1].color.a, 0.5F);
  EXPECT_EQ(found.markers[1].points, surfaces.markers[1].points);
  EXPECT_EQ(found.markers[3].type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(found.markers[3].pose.position.z, 0.4);
  EXPECT_THAT(found.markers[3].text, testing::StartsWith("REFUSED"));
  const Marker& why = found.markers[4];
  EXPECT_EQ(why.type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(why.pose.position.z, -0.1);
  EXPECT_EQ(std::count(why.text.begin(), why.text.end(), '\n'), 1);
  std::string in_one_line = why.text;
  std::replace(in_one_line.begin(), in_one_line.end(), '\n', ' ');
  EXPECT_EQ(in_one_line, reason);
}

TEST(ProposedMarkers, AreAmberAndSayWhatWaitsWhereThereIsAPlaceForIt) {
  const auto surfaces = to_markers(two_surfaces(), {{2, {"kidney", {}}}}, "ct", 3735928559U);
  const Eigen::Isometry3d T_patient_ct(Eigen::Translation3d(250.0, 0.0, 0.0));
  ProposedAlignment proposed{"patient", T_patient_ct, "result 3 waits", Eigen::Vector3d(0, 0, 400)};
  const auto found = proposed_markers(surfaces, proposed, 0.5);
  ASSERT_EQ(found.markers.size(), 4u);
  EXPECT_EQ(found.markers[0].action, Marker::DELETEALL);
  EXPECT_EQ(found.markers[0].header.frame_id, "patient");
  for (std::size_t i = 1; i < 4; ++i) {
    EXPECT_EQ(found.markers[i].ns, "PROPOSED");
    EXPECT_EQ(found.markers[i].header.frame_id, "patient");
    EXPECT_GT(found.markers[i].color.r, 0.9F);
    EXPECT_GT(found.markers[i].color.g, 0.6F);
    EXPECT_LT(found.markers[i].color.b, 0.2F);
  }
  EXPECT_EQ(found.markers[1].pose.position.x, 0.25);
  EXPECT_EQ(found.markers[1].color.a, 0.5F);
  EXPECT_EQ(found.markers[3].pose.position.z, 0.4);
  EXPECT_EQ(found.markers[3].text, "PROPOSED: result 3 waits");
  proposed.text_mm.reset();
  EXPECT_EQ(proposed_markers(surfaces, proposed, 0.5).markers.size(), 3u);
}

TEST(NotInForceMarker, IsAGreyText) {
  const Marker marker = not_in_force_marker("tf does not have it", "patient", {0, 0, 400});
  EXPECT_EQ(marker.type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(marker.ns, "NOT IN FORCE");
  EXPECT_EQ(marker.header.frame_id, "patient");
  EXPECT_EQ(marker.text, "tf does not have it");
  EXPECT_EQ(marker.pose.position.z, 0.4);
  EXPECT_EQ(marker.color.r, marker.color.g);
  EXPECT_EQ(marker.color.r, marker.color.b);
}

TEST(RefusedMarkers, SayWhyWithoutSurfacesToo) {
  const auto found = refused_markers(
      {}, {"patient", Eigen::Isometry3d::Identity(), "no reason", {0, 0, 0}, {0, 0, 0}}, 0.5);
  ASSERT_EQ(found.markers.size(), 3u);
  EXPECT_EQ(found.markers[2].text, "no reason");
}

}  // namespace
}  // namespace usct::ros_interface
