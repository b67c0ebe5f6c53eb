#include "ros/us_cloud.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::UsCloud>(argc, argv, "us_cloud");
}
