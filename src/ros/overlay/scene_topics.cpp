#include "ros/overlay/scene_topics.h"

#include <ros/console.h>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

template <typename Message>
::ros::Subscriber subscribe(::ros::NodeHandle& node, const char* topic, OverlaySceneKeeper& keeper,
                            void (OverlaySceneKeeper::*take)(const Message&)) {
  constexpr std::uint32_t kQueue = 5;
  return node.subscribe<Message>(
      topic, kQueue,
      boost::function<void(const boost::shared_ptr<const Message>&)>(
          [&keeper, take](const boost::shared_ptr<const Message>& message) {
            try {
              (keeper.*take)(*message);
            } catch (const InputError& error) {
              ROS_ERROR("%s", error.what());
            }
          }));
}

}  // namespace

std::vector<::ros::Subscriber> subscribe_to_scene(::ros::NodeHandle node,
                                                  OverlaySceneKeeper& keeper) {
  return {subscribe(node, "ct/info", keeper, &OverlaySceneKeeper::take_info),
          subscribe(node, "ct/surface", keeper, &OverlaySceneKeeper::take_surface),
          subscribe(node, "registration/alignment", keeper, &OverlaySceneKeeper::take_alignment),
          subscribe(node, "registration/pose", keeper, &OverlaySceneKeeper::take_pose),
          subscribe(node, "registration/result", keeper, &OverlaySceneKeeper::take_result)};
}

}  // namespace usct::ros_interface
