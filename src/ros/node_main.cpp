#include "ros/node_main.h"

#include <ros/ros.h>

#include <exception>
#include <map>
#include <memory>

#include "ros/alignment/tf_publisher.h"
#include "ros/crtk/crtk_bridge.h"
#include "ros/ct/ct_server.h"
#include "ros/fusion/fusion_view.h"
#include "ros/fusion/us_cloud.h"
#include "ros/ingest/us_ingest.h"
#include "ros/node/guarded_queue.h"
#include "ros/overlay/video_overlay.h"
#include "ros/registration/registration_node.h"
#include "ros/slicer/slicer_bridge.h"

namespace usct::ros_interface {
namespace {

using Started = std::shared_ptr<void>;
using Start = Started (*)(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

template <class Node>
Started start(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node) {
  return std::make_shared<Node>(node, private_node);
}

const std::map<std::string, Start> kStarts = {
    {"crtk_bridge", start<CrtkBridge>},     {"ct_server", start<CtServer>},
    {"fusion_view", start<FusionViewNode>}, {"registration", start<RegistrationNode>},
    {"slicer_bridge", start<SlicerBridge>}, {"tf_publisher", start<TfPublisher>},
    {"us_cloud", start<UsCloud>},           {"us_ingest", start<UsIngest>},
    {"video_overlay", start<VideoOverlay>},
};

}  // namespace

// Callbacks run on several threads, so that a node receives a cancel while another of its callbacks
// waits.
int run_node(int argc, char** argv, const std::string& name) {
  ::ros::init(argc, argv, name);
  // The handles outlive the try block: ROS shuts down with the last of them, and the message below
  // would be lost.
  ::ros::NodeHandle node;
  ::ros::NodeHandle private_node("~");
  try {
    constexpr unsigned kThreads = 4;
    GuardedQueue queue(*node.getCallbackQueue());
    const Started started =
        kStarts.at(name)(with_queue(node, queue), with_queue(private_node, queue));
    // It ends first, and waits for callbacks that still use the node.
    ::ros::AsyncSpinner spinner(kThreads);
    spinner.start();
    ::ros::waitForShutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
  return 0;
}

}  // namespace usct::ros_interface
