#include "ros/ct_server.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::CtServer>(argc, argv, "ct_server");
}
