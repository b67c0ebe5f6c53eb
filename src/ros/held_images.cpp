#include "ros/held_images.h"

#include <algorithm>

namespace usct::ros_interface {

bool is_older(const HeldUltrasound& us, const HeldCt& ct) {
  if (us.epoch.number < ct.epoch.number) return true;
  if (us.epoch.number == ct.epoch.number) return us.header.stamp < ct.header.stamp;
  return us.header.stamp < std::min(ct.header.stamp, us.epoch.begin);
}

}  // namespace usct::ros_interface
