#!/usr/bin/env python3
"""What scripts/demo asks of the running nodes, as any other program of the operating room would.

  demo_client.py ready                   waits until all nodes are up and the CT is there
  demo_client.py acquired                waits until there is an ultrasound volume
  demo_client.py initial INFO.json       tells the registration where to start; INFO: usct info --json
  demo_client.py ct_in_tf FOUND.tfm [TARGETS_CT.csv]
                                         looks the CT up in tf, writes the transform of the result, and
                                         compares tf with truth/alignment at the targets, if given
"""
import csv
import json
import sys

import numpy
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from us_ct_registration.msg import CtInfo, PreScanVolume, RegistrationResult, StatusCode
from us_ct_registration.srv import SetInitialAlignment, SetInitialAlignmentRequest

LIMIT_S = 120.0
MM_PER_M = 1000.0
WORST_MEAN_MM = 2.0


def quaternion_of(rotation):
    """The eigenvector of the largest eigenvalue of Bar-Itzhack's matrix."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = numpy.array([[xx - yy - zz, yx + xy, zx + xz, zy - yz], [yx + xy, yy - xx - zz, zy + yz, xz - zx],
                          [zx + xz, zy + yz, zz - xx - yy, yx - xy], [zy - yz, xz - zx, yx - xy, xx + yy + zz]])
    return Quaternion(*numpy.linalg.eigh(matrix)[1][:, -1])


def matrix_of(transform):
    """4 x 4, mm, of a geometry_msgs/Transform."""
    q, t = transform.rotation, transform.translation
    cross = numpy.array([[0, -q.z, q.y], [q.z, 0, -q.x], [-q.y, q.x, 0]])
    matrix = numpy.eye(4)
    matrix[:3, :3] += 2 * q.w * cross + 2 * cross @ cross
    matrix[:3, 3] = MM_PER_M * numpy.array([t.x, t.y, t.z])
    return matrix


def latched(topic, kind):
    return rospy.wait_for_message(topic, kind, LIMIT_S)


def ready():
    for service in ("/register", "/registration/accept", "/registration/set_initial_alignment"):
        rospy.wait_for_service(service, LIMIT_S)
    info = latched("/ct/info", CtInfo)
    print(f"CT: {' x '.join(map(str, info.size))} voxels, {info.lowest} to {info.highest} HU")


def acquired():
    volume = latched("/us/volume", PreScanVolume)
    print(f"ultrasound: {volume.samples} x {volume.lines} x {volume.frames}, acquired at "
          f"{volume.header.stamp.to_sec():.3f} in '{volume.header.frame_id}'")


def initial(info_path):
    with open(info_path) as stream:
        T_us_ct = numpy.array(json.load(stream)["T_us_ct"])
    request = SetInitialAlignmentRequest(type=SetInitialAlignmentRequest.POSE)
    request.header.frame_id = latched("/us/volume", PreScanVolume).header.frame_id
    request.transform.translation = Vector3(*T_us_ct[:3, 3] / MM_PER_M)
    request.transform.rotation = quaternion_of(T_us_ct[:3, :3])
    status = rospy.ServiceProxy("/registration/set_initial_alignment", SetInitialAlignment)(request).status
    if status.code != StatusCode.OK:
        sys.exit(f"the initial alignment was refused: {status.message}")


def write_itk_transform(path, T_us_ct):
    """ITK's files map points of the fixed image, the ultrasound, to the moving one."""
    T_ct_us = numpy.linalg.inv(T_us_ct)
    numbers = " ".join(repr(float(x)) for x in [*T_ct_us[:3, :3].ravel(), *T_ct_us[:3, 3]])
    with open(path, "w") as stream:
        stream.write("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                     f"Parameters: {numbers}\nFixedParameters: 0 0 0\n")


def ct_in_tf(found_path, targets_path=None):
    result = latched("/registration/result", RegistrationResult)
    if result.status.code != StatusCode.REGISTERED:
        sys.exit(f"not registered: {result.status.message}")
    write_itk_transform(found_path, matrix_of(result.transform))
    buffer = tf2_ros.Buffer()
    tf2_ros.TransformListener(buffer)
    found = buffer.lookup_transform(result.fixed_frame, result.ct_frame, rospy.Time(0), rospy.Duration(LIMIT_S))
    print(f"tf: '{found.header.frame_id}' -> '{found.child_frame_id}', "
          f"translation {matrix_of(found.transform)[:3, 3].round(2).tolist()} mm")
    if targets_path is None:
        return
    truth = latched("/truth/alignment", TransformStamped)
    if (truth.header.frame_id, truth.child_frame_id) != (found.header.frame_id, found.child_frame_id):
        sys.exit(f"tf and truth are about different frames: {found} {truth}")
    with open(targets_path) as stream:
        points_ct_mm = numpy.array([[float(row[axis]) for axis in "xyz"] for row in csv.DictReader(stream)])
    apart = matrix_of(found.transform) - matrix_of(truth.transform)
    errors_mm = numpy.linalg.norm(points_ct_mm @ apart[:3, :3].T + apart[:3, 3], axis=1)
    print(f"tf against the truth at {len(errors_mm)} points of the kidney's surface, mm: "
          f"mean {errors_mm.mean():.2f}, max {errors_mm.max():.2f}")
    if errors_mm.mean() > WORST_MEAN_MM:
        sys.exit(f"the mean error must be <= {WORST_MEAN_MM} mm")


def main():
    tasks = {"ready": ready, "acquired": acquired, "initial": initial, "ct_in_tf": ct_in_tf}
    if len(sys.argv) < 2 or sys.argv[1] not in tasks:
        sys.exit(__doc__)
    rospy.init_node("demo_client", anonymous=True)
    tasks[sys.argv[1]](*sys.argv[2:])


if __name__ == "__main__":
    main()
