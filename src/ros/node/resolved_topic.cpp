#include "ros/node/resolved_topic.h"

namespace usct::ros_interface {

::ros::NodeHandle node_for_resolved(const ::ros::NodeHandle& node, const std::string& topic) {
  // Not a copy of `node`: that one may have remappings of its own, as a nodelet has, which come
  // first.
  ::ros::NodeHandle resolved("/", {{topic, topic}});
  resolved.setCallbackQueue(node.getCallbackQueue());
  return resolved;
}

}  // namespace usct::ros_interface
