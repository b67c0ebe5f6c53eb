#include "ros/ingest/us_ingest.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::UsIngest>(argc, argv, "us_ingest");
}
