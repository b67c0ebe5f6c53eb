#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include "ros/conversions/point_clouds.h"
#include "ros/unit/two_surfaces.h"

namespace usct::ros_interface {
namespace {

template <typename T>
std::vector<T> values_of(const sensor_msgs::PointCloud2& cloud, const std::string& field) {
  std::vector<T> values;
  for (sensor_msgs::PointCloud2ConstIterator<T> value(cloud, field); value != value.end(); ++value)
    values.push_back(*value);
  return values;
}

TEST(PointClouds, OfSurfacesHaveTheLabels) {
  const auto cloud = to_points(two_surfaces(), "ct");
  ASSERT_EQ(cloud.width * cloud.height, 6U);
  EXPECT_EQ(cloud.header.frame_id, "ct");
  EXPECT_EQ(cloud.header.stamp, ros::Time(0));
  EXPECT_THAT(values_of<float>(cloud, "x"), testing::ElementsAre(0, 1, 0, 0, 1, 0));
  EXPECT_THAT(values_of<float>(cloud, "y"), testing::ElementsAre(0, 0, 2, 0, 0, 2));
  EXPECT_THAT(values_of<float>(cloud, "z"), testing::ElementsAre(0, 0, -0.5, 0, 0, -0.5));
  EXPECT_THAT(values_of<std::uint32_t>(cloud, "label"), testing::ElementsAre(2, 2, 2, 5, 5, 5));
}

TEST(PointClouds, AreInMetresWithTheIntensityLast) {
  std_msgs::Header header;
  header.frame_id = "patient";
  header.stamp = ros::Time(1700000000, 123456789);
  const sensor_msgs::PointCloud2 cloud =
      to_message({{{1000.0, -500.0, 250.0}, 42.0F}, {{0.0, 0.0, 1.0}, -100.0F}}, header);
  EXPECT_EQ(cloud.header.frame_id, "patient");
  EXPECT_EQ(cloud.header.stamp, header.stamp) << "to the nanosecond";
  ASSERT_EQ(cloud.width * cloud.height, 2U);
  EXPECT_THAT(values_of<float>(cloud, "x"), testing::ElementsAre(1, 0));
  EXPECT_THAT(values_of<float>(cloud, "y"), testing::ElementsAre(-0.5, 0));
  EXPECT_THAT(values_of<float>(cloud, "z"), testing::ElementsAre(0.25, 0.001F));
  EXPECT_THAT(values_of<float>(cloud, "intensity"), testing::ElementsAre(42, -100));
}

/// Subscribers that know the layout need no map of the fields.
TEST(PointClouds, HaveFourValuesPerPointWithoutPadding) {
  for (const auto& cloud :
       {to_points(two_surfaces(), "ct"), to_message({{{1.0, 2.0, 3.0}, 4.0F}}, {})}) {
    EXPECT_EQ(cloud.point_step, 16U);
    EXPECT_EQ(cloud.row_step, 16U * cloud.width);
    EXPECT_EQ(cloud.data.size(), 16U * cloud.width);
    EXPECT_TRUE(cloud.is_dense);
    ASSERT_EQ(cloud.fields.size(), 4U);
    for (std::uint32_t i = 0; i < 4; ++i) EXPECT_EQ(cloud.fields[i].offset, 4 * i);
  }
}

TEST(PointClouds, NoPointsMakeAnEmptyCloud) {
  const sensor_msgs::PointCloud2 cloud = to_message(std::vector<CloudPoint>{}, {});
  EXPECT_EQ(cloud.width, 0U);
  EXPECT_EQ(cloud.fields.size(), 4U);
}

TEST(PolygonMesh, HasTheTrianglesOfAllSurfacesOverOneCloud) {
  const pcl_msgs::PolygonMesh mesh = to_mesh(two_surfaces(), "ct");
  EXPECT_EQ(mesh.header.frame_id, "ct");
  EXPECT_EQ(mesh.cloud, to_points(two_surfaces(), "ct"));
  ASSERT_EQ(mesh.polygons.size(), 3U);
  EXPECT_THAT(mesh.polygons[0].vertices, testing::ElementsAre(0, 1, 2));
  EXPECT_THAT(mesh.polygons[1].vertices, testing::ElementsAre(2, 1, 0));
  EXPECT_THAT(mesh.polygons[2].vertices, testing::ElementsAre(3, 4, 5));
}

}  // namespace
}  // namespace usct::ros_interface
