#!/usr/bin/env python3
"""Writes what a robot with a stereo endoscope and a drop-in ultrasound probe would have recorded of a phantom patient:
measured_js and measured_cp of both arms (CRTK, dVRK's names), live B-mode images, the endoscope's video and its truth.

  robot_bag.py CASE --output FOLDER

CASE: a folder of usct phantom --endoscope --sweep tracked-curvilinear. Writes FOLDER/robot.bag; FOLDER/images.yaml, what
us_ingest must know of the images; FOLDER/robot.urdf, the model with the arms docked at this patient; FOLDER/truth.tfm, the true pose of the CT in the robot's base, in which us_ingest
assembles the sweep. The bag holds no tf: that follows from the joints, the model of the robot and the calibrations, from which the
joints are made here by the inverse kinematics of urdf/integration.urdf, without code of the nodes. docs/integration.md
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import numpy
import rosbag
import rospy
import yaml
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

import live_video
from demo_client import MM_PER_M, quaternion_of, write_itk_transform
from overlay_error import T_us_ct_of

PROJECT = pathlib.Path(__file__).resolve().parents[1]
JOINTS = ["yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw"]
ARMS = {"ECM": ("ECM_base", "endoscope_tip"), "PSM1": ("PSM1_base", "PSM1_tool_tip")}
FIXED_FRAME, IMAGE_FRAME, CAMERA_FRAME = "robot_base", "us_image", "endoscope_left_optical"
# The joints of an arm, in the order of JOINTS, in the middle of its work, for which it is docked.
DOCKED = [0.0, 0.0, 0.125, 1.6, 0.0, 0.0]
RATE_HZ = 100.0
# s: the robot is there before the first image of the ultrasound or of the video, and stays after the last.
BEFORE_S, AFTER_S = 2.5, 6.0
# s and m: after the sweep the probe stays for a moment and is then pulled back.
STAY_S, RETRACT_S, RETRACT_M = 1.0, 1.0, 0.05
# Where the frame of the phantom's sweep lies in the robot's base, as Euler angles and mm: the probe looks down.
US_POSE = "-1.4 0.1 0.3 650 -460 590"


def rotation(axis, angle):
    """4 x 4, about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    T = numpy.eye(4)
    T[:3, :3] += numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross
    return T


def translation(vector):
    T = numpy.eye(4)
    T[:3, 3] = vector
    return T


class Robot:
    """The model of a robot: a URDF, in m."""

    def __init__(self, path):
        self.model = ElementTree.parse(path)
        self.joints = {joint.find("child").get("link"): joint for joint in self.model.getroot().iter("joint")}

    @staticmethod
    def numbers(element, key):
        return [float(x) for x in (element.get(key, "0 0 0") if element is not None else "0 0 0").split()]

    def chain(self, base, tip):
        """The joints from base to tip."""
        found = []
        while tip != base:
            found.insert(0, self.joints[tip])
            tip = found[0].find("parent").get("link")
        return found

    def pose(self, base, tip, positions=None):
        """4 x 4, m; positions by the names of the joints."""
        T = numpy.eye(4)
        for joint in self.chain(base, tip):
            origin = joint.find("origin")
            roll, pitch, yaw = self.numbers(origin, "rpy")
            T = T @ translation(self.numbers(origin, "xyz")) @ rotation((0, 0, 1), yaw) @ \
                rotation((0, 1, 0), pitch) @ rotation((1, 0, 0), roll)
            if joint.get("type") == "fixed":
                continue
            axis, position = numpy.array(self.numbers(joint.find("axis"), "xyz")), positions[joint.get("name")]
            T = T @ (translation(position * axis) if joint.get("type") == "prismatic" else rotation(axis, position))
        return T

    def dock(self, arm, T_fixed_tip):
        """Sets the arm up so that its joints are DOCKED where its tip has this pose in the fixed frame."""
        base, tip = ARMS[arm]
        joints = {f"{arm}_{name}": x for name, x in zip(JOINTS, DOCKED)}
        T = T_fixed_tip @ numpy.linalg.inv(self.pose(base, tip, joints))
        R = T[:3, :3]
        angles = numpy.arctan2(R[2, 1], R[2, 2]), -numpy.arcsin(R[2, 0]), numpy.arctan2(R[1, 0], R[0, 0])
        mount = self.joints[base].find("origin")
        mount.set("xyz", " ".join(f"{x:.4f}" for x in T[:3, 3]))
        mount.set("rpy", " ".join(f"{x:.4f}" for x in angles))

    def inverse(self, arm, T):
        """Positions, in the order of JOINTS, for the pose T of the arm's tip in its base. The arm is a remote centre of
        motion with a wrist whose axes meet in a point."""
        base, tip = ARMS[arm]
        length = self.numbers(self.chain(base, tip)[-1].find("origin"), "xyz")[2]
        wrist = (T @ translation((0, 0, -length)))[:3, 3]
        insertion = numpy.linalg.norm(wrist)
        yaw, pitch = numpy.arctan2(wrist[0], wrist[2]), -numpy.arcsin(wrist[1] / insertion)
        R = (rotation((0, 1, 0), yaw) @ rotation((1, 0, 0), pitch))[:3, :3].T @ T[:3, :3]
        positions = [yaw, pitch, insertion, numpy.arctan2(-R[0, 1], R[1, 1]), numpy.arcsin(R[2, 1]),
                     numpy.arctan2(-R[2, 0], R[2, 2])]
        self.require_within_limits(arm, positions)
        again = self.pose(base, tip, {f"{arm}_{name}": x for name, x in zip(JOINTS, positions)})
        if not numpy.allclose(again, T, atol=1e-9):
            sys.exit(f"the model's arm {arm} has other kinematics than those that this program inverts")
        return positions

    def require_within_limits(self, arm, positions):
        joints = {joint.get("name"): joint.find("limit") for joint in self.chain(*ARMS[arm])}
        for name, position in zip(JOINTS, positions):
            limit = joints[f"{arm}_{name}"]
            lower, upper = float(limit.get("lower")), float(limit.get("upper"))
            if not lower <= position <= upper:
                sys.exit(f"{arm} cannot reach a pose: '{name}' would be {position:.3f}, must be in [{lower}, {upper}]")


class Calibrations:
    """The static transforms of a calibration file: m."""

    def __init__(self, path):
        self.above = {}
        for entry in yaml.safe_load(path.read_text()).values():
            q = entry["transform"]["rotation"]
            vector = numpy.array([q["x"], q["y"], q["z"]])
            sine = numpy.linalg.norm(vector)
            T = translation([entry["transform"]["translation"][axis] for axis in "xyz"])
            if sine > 0:
                T = T @ rotation(vector / sine, 2 * numpy.arctan2(sine, q["w"]))
            self.above[entry["child_frame_id"]] = entry["header"]["frame_id"], T

    def pose(self, base, frame):
        T = numpy.eye(4)
        while frame != base:
            frame, T_parent_frame = self.above[frame]
            T = T_parent_frame @ T
        return T


def in_metres(T_mm):
    T = T_mm.copy()
    T[:3, 3] /= MM_PER_M
    return T


class Track:
    """Positions of an arm's joints at some times, s; straight lines between them."""

    def __init__(self, robot, arm, times_s, poses):
        """`poses` of the tip in the robot's base; the arm is docked at the middle one."""
        self.robot, self.arm = robot, arm
        robot.dock(arm, poses[len(poses) // 2])
        T_arm_base = numpy.linalg.inv(robot.pose(FIXED_FRAME, ARMS[arm][0]))
        self.times_s = list(times_s)
        self.positions = [robot.inverse(arm, T_arm_base @ T) for T in poses]

    def retract(self):
        last = self.positions[-1]
        pulled = [x - RETRACT_M * (name == "insertion") for name, x in zip(JOINTS, last)]
        self.robot.require_within_limits(self.arm, pulled)
        end_s = self.times_s[-1] + STAY_S
        self.times_s += [end_s, end_s + RETRACT_S]
        self.positions += [last, pulled]

    def messages(self, begin_s, end_s):
        """measured_js and measured_cp, at a fixed rate and at the times of the track."""
        base, tip = ARMS[self.arm]
        own = numpy.array([t for t in self.times_s if begin_s <= t <= end_s])
        grid = numpy.arange(begin_s, end_s, 1 / RATE_HZ)
        # Robots do not measure twice in two milliseconds.
        times = numpy.sort(numpy.append(own, [t for t in grid if not (numpy.abs(own - t) < 0.002).any()]))
        columns = [numpy.interp(times, self.times_s, column) for column in numpy.transpose(self.positions)]
        for time_s, positions in zip(times, numpy.transpose(columns)):
            joints = JointState(name=JOINTS, position=list(positions))
            joints.header.stamp = rospy.Time.from_sec(time_s)
            yield time_s, f"/{self.arm}/measured_js", joints
            T = self.robot.pose(base, tip, {f"{self.arm}_{name}": x for name, x in zip(JOINTS, positions)})
            pose = PoseStamped()
            pose.header.stamp, pose.header.frame_id = joints.header.stamp, base
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = T[:3, 3]
            pose.pose.orientation = quaternion_of(T[:3, :3])
            yield time_s, f"/{self.arm}/measured_cp", pose


def video_bag(options, folder):
    """The video and its truth as usct bag write has them, which has another robot."""
    pose = folder / "pose.tfm"
    pose.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                    f"Parameters: {US_POSE}\nFixedParameters: 0 0 0 0\n")
    bag = folder / "video.bag"
    case = options.case
    subprocess.run([options.usct, "bag", "write", "--us", case / "us.nrrd", "--fixed-pose", pose, "--fixed-frame",
                    FIXED_FRAME, "--truth", case / "truth.tfm", "--endoscope", case / "endoscope", "--endoscope-delay",
                    str(options.delay), "--start", repr(options.start), "--output", bag],
                   check=True, stdout=subprocess.DEVNULL)
    with rosbag.Bag(str(bag)) as recorded:
        for topic, message, time in recorded.read_messages():
            if topic.startswith(("/endoscope", "/truth")):
                yield time.to_sec(), topic, message


def write(options):
    robot, calibrations = Robot(options.robot), Calibrations(options.calibration)
    sweep = live_video.Sweep(options.case / "us.nrrd")
    probe = live_video.PicturedProbe(sweep, (options.output / "probe.yaml").resolve())
    T_base_us = live_video.matrix_of_euler(US_POSE)
    T_base_ct = T_base_us @ T_us_ct_of(options.case / "truth.tfm")
    stamps_s = [options.start + time_s for time_s in sweep.times_s]
    messages = list(video_bag(options, pathlib.Path(options.scratch)))
    video_s = sorted({time_s for time_s, topic, _ in messages if topic.endswith("left/image_raw")})
    cameras = [numpy.reshape(frame["T_ct_left"], (4, 4))
               for frame in json.loads((options.case / "endoscope/endoscope.json").read_text())["frames"]]
    T_camera_tip = numpy.linalg.inv(calibrations.pose(ARMS["ECM"][1], CAMERA_FRAME))
    T_image_tip = numpy.linalg.inv(calibrations.pose(ARMS["PSM1"][1], IMAGE_FRAME))
    endoscope = Track(robot, "ECM", video_s, [in_metres(T_base_ct @ T) @ T_camera_tip for T in cameras])
    probe_arm = Track(robot, "PSM1", stamps_s, [in_metres(T_base_us @ T) @ T_image_tip for T in sweep.T_us_frame])
    probe_arm.retract()
    for arm in endoscope, probe_arm:
        for first_s, last_s in ((stamps_s[0], stamps_s[-1]), (video_s[0], video_s[-1])):
            messages += arm.messages(first_s - BEFORE_S, last_s + AFTER_S)
    pictures = [probe.picture(frame) for frame in sweep.samples]
    messages += [(stamp_s, "/us/image", live_video.image_of(picture, stamp_s))
                 for picture, stamp_s in zip(pictures, stamps_s)]
    live_video.write_messages(options.output / "robot.bag", messages)
    live_video.describe(options.output / "images.yaml", probe, pictures[0], pose_frame=FIXED_FRAME, image_frame=IMAGE_FRAME)
    robot.model.write(options.output / "robot.urdf")
    write_itk_transform(options.output / "truth.tfm", T_base_ct)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=pathlib.Path)
    parser.add_argument("--output", type=pathlib.Path, required=True, help="folder to write to")
    parser.add_argument("--robot", type=pathlib.Path, default=PROJECT / "urdf/integration.urdf")
    parser.add_argument("--calibration", type=pathlib.Path, default=PROJECT / "config/calibration/synthetic.yaml")
    parser.add_argument("--start", type=float, default=1000.0, help="stamp of the first ultrasound image, s since 1970")
    parser.add_argument("--delay", type=float, default=900.0, help="s from the last ultrasound image to the video")
    parser.add_argument("--usct", default="usct", help="the program usct")
    options = parser.parse_args()
    for name in ("us.nrrd", "truth.tfm", "endoscope/endoscope.json"):
        if not (options.case / name).is_file():
            parser.error(f"'{options.case / name}' does not exist: CASE must be made by usct phantom --endoscope "
                         "--sweep tracked-curvilinear")
    options.output.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as options.scratch:
        write(options)


if __name__ == "__main__":
    main()
