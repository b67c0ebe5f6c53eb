#!/usr/bin/env python3
"""What scripts/demo, and tests, ask of the running nodes, as any other program of the operating room would.

  demo_client.py segment CASE            what a surgeon would have outlined in a phantom's CT: CASE/segmentation.nrrd
  demo_client.py ready                   waits until all nodes are up and the CT is there
  demo_client.py go_on /PLAYER           lets rosbag play, started with --pause and __name:=PLAYER, go on once all who
                                         listen are connected: what it plays before that reaches nobody
  demo_client.py acquired [SECONDS]      waits for an ultrasound volume, with a stamp after SECONDS
  demo_client.py next_loop /PLAYER       lets rosbag play -l go on to its next loop, and pauses it once the ultrasound
                                         volume of that loop is there
  demo_client.py initial INFO.json       tells the registration where to start; INFO: usct info --json
  demo_client.py found FOUND.tfm         writes the transform of the newest result
  demo_client.py result RESULT.json      writes the newest result, for usct slices; ends with status 3 if it was refused
                                         but has a candidate, and with 1 if there is nothing to draw
  demo_client.py ct_in_tf [TARGETS_CT.csv [MM]]
                                         looks the CT up in tf; compares it with truth/alignment at the targets, where
                                         the mean error must be at most this
  demo_client.py no_ct_in_tf [SECONDS]   fails if tf has a CT, or gets one within this time
  demo_client.py moved_away MM           waits until the probe is this far from where it acquired the volume
  demo_client.py restored                waits until an alignment from before a restart is broadcast
"""
import csv
import json
import sys
import time

import numpy
import ros_graph
import rospy
import tf2_ros
import yaml
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from std_srvs.srv import SetBool
from us_ct_registration.msg import Alignment, CtInfo, PreScanVolume, RegistrationResult, StatusCode
from us_ct_registration.srv import SetInitialAlignment, SetInitialAlignmentRequest

LIMIT_S = 120.0
MM_PER_M = 1000.0
WORST_MEAN_MM = 2.0
PAUSED_AFTER_S = 1.0


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


def first(topic, kind, condition=lambda message: True):
    """The first message (a latched one comes at once) that fulfils the condition."""
    end = time.monotonic() + LIMIT_S
    found = []
    subscriber = rospy.Subscriber(topic, kind, lambda message: found.append(message) if condition(message) else None)
    while not found:
        if time.monotonic() > end:
            sys.exit(f"waited {LIMIT_S:.0f} s for {topic}")
        time.sleep(0.02)
    subscriber.unregister()
    return found[0]


def look_up(target, source, condition=lambda T: True):
    """The newest transform that fulfils the condition, 4 x 4, mm. Wall time: the clock of a bag may stand still."""
    end = time.monotonic() + LIMIT_S
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    while time.monotonic() < end:
        try:
            T = matrix_of(buffer.lookup_transform(target, source, rospy.Time(0)).transform)
            if condition(T):
                listener.unregister()
                return T
        except tf2_ros.TransformException:
            pass
        time.sleep(0.02)
    sys.exit(f"waited {LIMIT_S:.0f} s for '{target}' -> '{source}' in tf")


def segment(case):
    """The phantom labels each tissue; an outlined kidney is several of them."""
    outlined = {1: ("cortex", "medulla", "sinus_fat", "urine"), 2: ("tumour",), 3: ("artery",), 4: ("vein",)}
    with open(f"{case}/phantom.json") as stream:
        tissues = {name: int(label) for label, name in json.load(stream)["labels"].items()}
    with open(f"{case}/labels.nrrd", "rb") as stream:
        header, voxels = stream.read().split(b"\n\n", 1)
    labels = numpy.frombuffer(voxels, "<u2")
    segmentation = numpy.zeros_like(labels)
    for label, names in outlined.items():
        segmentation[numpy.isin(labels, [tissues[name] for name in names])] = label
    with open(f"{case}/segmentation.nrrd", "wb") as stream:
        stream.write(header + b"\n\n" + segmentation.tobytes())


def ready():
    for service in ("/register", "/registration/accept", "/registration/set_initial_alignment"):
        rospy.wait_for_service(service, LIMIT_S)
    info = first("/ct/info", CtInfo)
    print(f"CT: {' x '.join(map(str, info.size))} voxels, {info.lowest} to {info.highest} HU")


def acquired(after_s="0"):
    volume = first("/us/volume", PreScanVolume, lambda message: message.header.stamp.to_sec() > float(after_s))
    print(f"ultrasound: {volume.samples} x {volume.lines} x {volume.frames}, acquired at "
          f"{volume.header.stamp.to_sec():.3f} in '{volume.header.frame_id}'")


def next_loop(player):
    """The player pauses PAUSED_AFTER_S after the sweep. On a busy machine it may already play the loop after that."""
    pause = rospy.ServiceProxy(f"{player}/pause_playback", SetBool)
    pause.wait_for_service(LIMIT_S)
    volumes = []
    rospy.Subscriber("/us/volume", PreScanVolume, volumes.append)
    first("/us/volume", PreScanVolume)  # latched: that of the loop before
    end = time.monotonic() + LIMIT_S
    pause(False)
    last_s, is_next = rospy.get_time(), False
    while time.monotonic() < end:
        now_s = rospy.get_time()
        if now_s < last_s:
            volumes.clear()
            is_next = True
        last_s = now_s
        if is_next and volumes and now_s > volumes[-1].header.stamp.to_sec() + PAUSED_AFTER_S:
            pause(True)
            if rospy.get_time() >= now_s:
                return
            pause(False)
        time.sleep(0.02)
    sys.exit(f"waited {LIMIT_S:.0f} s for the next loop of '{player}'")


def initial(info_path):
    with open(info_path) as stream:
        T_us_ct = numpy.array(json.load(stream)["T_us_ct"])
    request = SetInitialAlignmentRequest(type=SetInitialAlignmentRequest.POSE)
    request.header.frame_id = first("/us/volume", PreScanVolume).header.frame_id
    request.transform.translation = Vector3(*T_us_ct[:3, 3] / MM_PER_M)
    request.transform.rotation = quaternion_of(T_us_ct[:3, :3])
    set_initial_alignment = rospy.ServiceProxy("/registration/set_initial_alignment", SetInitialAlignment)
    set_initial_alignment.wait_for_service(LIMIT_S)
    # The volume may have reached this program before the registration, which then has nothing to anchor it by.
    end = time.monotonic() + LIMIT_S
    while (status := set_initial_alignment(request).status).code == StatusCode.NO_ULTRASOUND and time.monotonic() < end:
        time.sleep(0.1)
    if status.code != StatusCode.OK:
        sys.exit(f"the initial alignment was refused: {status.message}")


def write_itk_transform(path, T_us_ct):
    """ITK's files map points of the fixed image, the ultrasound, to the moving one."""
    T_ct_us = numpy.linalg.inv(T_us_ct)
    numbers = " ".join(repr(float(x)) for x in [*T_ct_us[:3, :3].ravel(), *T_ct_us[:3, 3]])
    with open(path, "w") as stream:
        stream.write("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                     f"Parameters: {numbers}\nFixedParameters: 0 0 0\n")


def result(path):
    """As docs/file_formats.md describes it; null is what a message holds in other units or not at all."""
    message = first("/registration/result", RegistrationResult)
    is_registered = message.status.code == StatusCode.REGISTERED
    names = {StatusCode.REGISTERED: "registered", StatusCode.LOW_CONFIDENCE: "low_confidence",
             StatusCode.NO_OVERLAP: "no_overlap"}
    known = {"status": names.get(message.status.code, "failed"), "message": message.status.message,
             "T_us_ct": matrix_of(message.transform).ravel().tolist() if is_registered else None,
             "similarity": message.similarity, "overlap": message.overlap, "covariance": None,
             "candidates": [{"T_us_ct": matrix_of(candidate.transform).ravel().tolist(),
                             "similarity": candidate.similarity, "overlap": candidate.overlap}
                            for candidate in message.candidates],
             "measures": {measure.name: measure.value for measure in message.measures if numpy.isfinite(measure.value)},
             "evaluations": message.evaluations,
             "seconds": {duration.name: duration.value for duration in message.durations},
             "options": {"preset": message.preset}, "version": message.version}
    with open(path, "w") as stream:
        json.dump({key: None if value != value else value for key, value in known.items()}, stream)
    if is_registered:
        return
    print(f"not registered: {message.status.message}")
    sys.exit(3 if message.candidates else 1)


def registered():
    result = first("/registration/result", RegistrationResult)
    if result.status.code != StatusCode.REGISTERED:
        sys.exit(f"not registered: {result.status.message}")
    return result


def found(path):
    write_itk_transform(path, matrix_of(registered().transform))


def ct_in_tf(targets_path=None, worst_mean_mm=WORST_MEAN_MM):
    alignment = first("/registration/alignment", Alignment, lambda message: message.state != Alignment.NONE)
    T_fixed_ct = look_up(alignment.header.frame_id, alignment.ct_frame)
    print(f"tf: '{alignment.header.frame_id}' -> '{alignment.ct_frame}', "
          f"translation {T_fixed_ct[:3, 3].round(2).tolist()} mm")
    if targets_path is None:
        return
    truth = first("/truth/alignment", TransformStamped)
    if (truth.header.frame_id, truth.child_frame_id) != (alignment.header.frame_id, alignment.ct_frame):
        sys.exit(f"tf and truth are about different frames:\n{alignment}\n{truth}")
    with open(targets_path) as stream:
        points_ct_mm = numpy.array([[float(row[axis]) for axis in "xyz"] for row in csv.DictReader(stream)])
    apart = T_fixed_ct - matrix_of(truth.transform)
    errors_mm = numpy.linalg.norm(points_ct_mm @ apart[:3, :3].T + apart[:3, 3], axis=1)
    print(f"tf against the truth at {len(errors_mm)} points of the kidney's surface, mm: "
          f"mean {errors_mm.mean():.2f}, max {errors_mm.max():.2f}")
    if errors_mm.mean() > float(worst_mean_mm):
        sys.exit(f"the mean error must be <= {worst_mean_mm} mm")


def no_ct_in_tf(seconds="2"):
    """Somebody must be heard to publish tf (the probe may have stopped): a tf that is not heard has no CT either."""
    alignment = first("/registration/alignment", Alignment)
    info = first("/ct/info", CtInfo)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    end = time.monotonic() + float(seconds)
    while time.monotonic() < end:
        time.sleep(0.1)
        frames = yaml.safe_load(buffer.all_frames_as_yaml()) or {}
        if info.header.frame_id in frames:
            sys.exit(f"'{info.header.frame_id}' is in tf: {frames}")
    if listener.tf_sub.get_num_connections() == 0:
        sys.exit("nobody publishes tf")
    listener.unregister()
    if alignment.state != Alignment.NONE:
        sys.exit(f"there is an alignment:\n{alignment}")
    print(f"no '{info.header.frame_id}' in tf: {alignment.message}")


def moved_away(distance_mm):
    result = registered()
    T_fixed_us = matrix_of(result.fixed_transform) @ numpy.linalg.inv(matrix_of(result.transform))
    look_up(result.fixed_frame, result.header.frame_id,
            lambda T: numpy.linalg.norm(T[:3, 3] - T_fixed_us[:3, 3]) >= float(distance_mm))


def restored():
    first("/registration/alignment", Alignment, lambda message: message.state == Alignment.RESTORED)


def main():
    tasks = {"segment": segment, "ready": ready, "go_on": ros_graph.go_on, "acquired": acquired, "next_loop": next_loop,
             "initial": initial, "found": found, "result": result, "ct_in_tf": ct_in_tf, "no_ct_in_tf": no_ct_in_tf,
             "moved_away": moved_away, "restored": restored}
    if len(sys.argv) < 2 or sys.argv[1] not in tasks:
        sys.exit(__doc__)
    if sys.argv[1] not in ("segment", "go_on"):
        rospy.init_node("demo_client", anonymous=True)
    tasks[sys.argv[1]](*sys.argv[2:])


if __name__ == "__main__":
    main()
