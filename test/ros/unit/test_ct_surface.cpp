#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include "ros/ct_surface.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using testing::HasSubstr;
using visualization_msgs::Marker;

std::map<int, Surface> two_surfaces() {
  Surface triangle;
  triangle.points_mm = {{0, 0, 0}, {1000, 0, 0}, {0, 2000, -500}};
  triangle.triangles = {{0, 1, 2}, {2, 1, 0}};
  Surface other = triangle;
  other.triangles.pop_back();
  return {{2, triangle}, {5, other}};
}

TEST(CtSurface, MarkersReplaceThoseBeforeAndAreInMetres) {
  const auto array = to_markers(two_surfaces(), {{2, "kidney"}}, "ct");
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

TEST(CtSurface, PointsHaveTheLabelsOfTheirSurfaces) {
  const auto cloud = to_points(two_surfaces(), "ct");
  ASSERT_EQ(cloud.width, 6U);
  EXPECT_EQ(cloud.header.frame_id, "ct");
  sensor_msgs::PointCloud2ConstIterator<float> z(cloud, "z");
  sensor_msgs::PointCloud2ConstIterator<std::uint32_t> label(cloud, "label");
  std::vector<float> all_z;
  std::vector<std::uint32_t> labels;
  for (; z != z.end(); ++z, ++label) {
    all_z.push_back(*z);
    labels.push_back(*label);
  }
  EXPECT_THAT(all_z, testing::ElementsAre(0, 0, -0.5, 0, 0, -0.5));
  EXPECT_THAT(labels, testing::ElementsAre(2, 2, 2, 5, 5, 5));
}

TEST(CtSurface, LabelNamesAreReadStrictly) {
  const auto names = label_names_from("1 left kidney;2 tumour ; 300 x", "~label_names");
  EXPECT_THAT(names, testing::ElementsAre(testing::Pair(1, "left kidney"),
                                          testing::Pair(2, "tumour"), testing::Pair(300, "x")));
  EXPECT_TRUE(label_names_from("", "~label_names").empty());
  for (const char* wrong :
       {"kidney", "1", "1 a; ;2 b", "0 background", "65536 x", "-1 x", "1 a;1 b"})
    EXPECT_THROW(label_names_from(wrong, "~label_names"), InputError) << wrong;
}

}  // namespace
}  // namespace usct::ros_interface
