#include "ros/tf_publisher.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::TfPublisher>(argc, argv,
                                                                         "tf_publisher");
}
