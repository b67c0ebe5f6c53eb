#include "ros/registration/held_images.h"

#include <algorithm>

namespace usct::ros_interface {

bool has_same_voxels(const HeldCt& a, const HeldCt& b) {
  return identity_of(a) == identity_of(b) && same_grid(a.volume.grid, b.volume.grid) &&
         a.volume.voxels == b.volume.voxels;
}

bool is_older(const HeldUltrasound& us, const HeldCt& ct) {
  if (us.epoch.number < ct.epoch.number) return true;
  if (us.epoch.number == ct.epoch.number) return us.header.stamp < ct.header.stamp;
  return us.header.stamp < std::min(ct.header.stamp, us.epoch.begin);
}

}  // namespace usct::ros_interface
