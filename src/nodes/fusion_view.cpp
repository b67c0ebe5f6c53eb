#include "ros/fusion_view.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::FusionViewNode>(argc, argv,
                                                                            "fusion_view");
}
