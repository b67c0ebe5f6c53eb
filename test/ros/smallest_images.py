"""The smallest images that the nodes take."""
import struct
import zlib

import rospy
from us_ct_registration.msg import CtInfo, CtVolume, PreScanVolume, ProbeGeometry


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


def ct(value, revision):
    """Such a CT, loaded before any ultrasound was acquired, whose voxels all have this value."""
    data = [value] * 512
    message = CtVolume(revision=revision, size=[8, 8, 8], spacing=[0.001] * 3, direction=[1, 0, 0, 0, 1, 0, 0, 0, 1],
                       data=data, crc32=ct_crc32(struct.pack("<512h", *data)))
    message.header.stamp, message.header.frame_id = rospy.Time(1000.0), "ct"
    return message


def info_of(volume):
    """What ct_server says of a CT before it sends the volume, as far as the nodes need it."""
    return CtInfo(header=volume.header, revision=volume.revision, crc32=volume.crc32, size=volume.size,
                  spacing=volume.spacing)
