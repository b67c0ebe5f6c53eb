#include "ros/video_overlay.h"

#include "ros/node_main.h"

int main(int argc, char** argv) {
  return usct::ros_interface::run_node<usct::ros_interface::VideoOverlay>(argc, argv,
                                                                          "video_overlay");
}
