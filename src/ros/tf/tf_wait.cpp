#include "ros/tf/tf_wait.h"

#include <us_ct_registration/StatusCode.h>

#include <chrono>
#include <thread>

#include "ros/conversions/times.h"
#include "ros/node/refusal.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

geometry_msgs::TransformStamped wait_for_transform(const TfBuffer& tf, const std::string& target,
                                                   const std::string& source,
                                                   const ::ros::Time& stamp, double timeout_s) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kPause(1);
  for (const std::string& frame : {target, source})
    if (!frame.empty() && frame.front() == '/')
      throw Refusal(us_ct_registration::StatusCode::INVALID_MESSAGE,
                    "the frame '" + frame + "' must be without leading /, which tf2 does not know");
  const auto end = Clock::now() + std::chrono::duration<double>(timeout_s);
  while (true) {
    std::string why;  // tf2 appends to it
    if (tf.can_transform(target, source, stamp, &why)) return tf.look_up(target, source, stamp);
    if (Clock::now() >= end)
      throw Refusal(us_ct_registration::StatusCode::TF_UNAVAILABLE,
                    "tf does not connect '" + source + "' to '" + target + "' at the stamp " +
                        seconds_text(stamp) + ": " + why);
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace usct::ros_interface
