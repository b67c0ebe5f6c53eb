#include "ros/node_main.h"

int main(int argc, char** argv) { return usct::ros_interface::run_node(argc, argv, "fusion_view"); }
