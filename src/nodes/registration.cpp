#include "ros/node_main.h"
#include "ros/registration_node.h"

int main(int argc, char** argv) {
  using namespace usct::ros_interface;
  return run_node<RegistrationNode>(argc, argv, "registration");
}
