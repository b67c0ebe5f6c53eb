"""The smallest images that the nodes take."""
import struct
import zlib

import rospy
from us_ct_registration.msg import PreScanVolume, ProbeGeometry


def ultrasound(frame):
    """The smallest motorised sweep."""
    data = bytes(8)
    geometry = ProbeGeometry(type=ProbeGeometry.MOTORISED_CURVILINEAR, probe_radius=0.04, motor_radius=0.027,
                             sample_spacing=0.001, line_angles=[-0.1, 0.1])
    message = PreScanVolume(geometry=geometry, samples=2, lines=2, frames=2, frame_angles=[-0.1, 0.1], data=data,
                            crc32=zlib.crc32(data))
    message.header.stamp, message.header.frame_id = rospy.Time.now(), frame
    return message


def ct_crc32(voxels):
    """The checksum of a CT of 8 x 8 x 8 voxels of 1 mm, at the origin."""
    geometry = struct.pack("<3I15d", 8, 8, 8, 0.001, 0.001, 0.001, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)
    return zlib.crc32(geometry, zlib.crc32(voxels))
