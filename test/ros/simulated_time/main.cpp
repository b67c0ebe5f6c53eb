#include <gtest/gtest.h>
#include <ros/ros.h>

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ::ros::init(argc, argv, "test_simulated_time");
  ::ros::NodeHandle keep_alive;
  ::ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
