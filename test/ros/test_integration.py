#!/usr/bin/env python3
"""A robot that speaks CRTK with a stereo endoscope and a drop-in ultrasound probe, through integration.launch: joints and
a URDF become tf, 2D images a sweep, and that an overlay, each compared with the truth. Wrong kinematics draw nothing."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy
import rosbag
import roslib.packages
import rospy
import rosunit
import yaml
from geometry_msgs.msg import TransformStamped

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import node_under_test
import overlay_case
import test_replay
from demo_client import MM_PER_M, quaternion_of
from overlay_error import T_us_ct_of, moved, tumour_points
from robot_bag import ARMS, CAMERA_FRAME, Calibrations, Robot
from us_ct_registration.msg import OverlayStatus

PROJECT, PACKAGE, run, wait_for = test_replay.PROJECT, test_replay.PACKAGE, test_replay.run, test_replay.wait_for
OK, ERROR = 0, 2  # of diagnostic_msgs/DiagnosticStatus, which has them as octets


class RobotCase(overlay_case.OverlayCase):
    """The phantom's sweep and video as the robot recorded them."""

    def __init__(self, folder, *phantom):
        super().__init__(folder, "--sweep", "tracked-curvilinear", *phantom)
        self.robot_folder = folder / "robot"

    def next_bag(self, pose, pause_s=60):
        self.start_s += 1000
        run([sys.executable, str(PROJECT / "scripts/robot_bag.py"), str(self.case), "--output", str(self.robot_folder),
             "--start", str(self.start_s), "--usct", test_replay.usct()], None)
        return (self.robot_folder / "robot.bag").rename(self.folder / f"{self.start_s}.bag")

    def T_base_ct(self):
        return T_us_ct_of(self.robot_folder / "truth.tfm")

    def start_off(self):
        """A start that is 5 mm off along each axis, in the format of demo_client.py."""
        file = self.robot_folder / "start.tfm"
        numbers = (self.robot_folder / "truth.tfm").read_text()
        file.write_text(re.sub("^Parameters: (.*)$", lambda line: "Parameters: " +
                               test_replay.shifted(line.group(1), 5.0), numbers, flags=re.M))
        return test_replay.initial_of(file)


def position_mm(point):
    return MM_PER_M * numpy.array([point.x, point.y, point.z])


def level_of(status):
    return ord(status.level) if isinstance(status.level, bytes) else status.level


def as_transform(pose, frame):
    transform = TransformStamped()
    transform.header.stamp, transform.header.frame_id = pose.header.stamp, frame
    for axis in "xyz":
        setattr(transform.transform.translation, axis, getattr(pose.pose.position, axis))
    transform.transform.rotation = pose.pose.orientation
    return transform


class TestIntegration(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_integration_"))
        self.case = RobotCase(self.folder, "--seed", "1", "--endoscope-size", "640", "360", "--endoscope-frames", "3",
                              "--endoscope-rate", "2")
        self.bag = self.case.next_bag(0)
        self.system = test_replay.System(self.folder, self.case)

    def tearDown(self):
        for name in ("recorder", "calibration", "bridge"):
            self.system.stop(name)
        self.system.stop_all()
        if node_under_test.has_failed(self):
            print(self.system.log())
        shutil.rmtree(self.folder)

    def crtk(self):
        """The parameters of crtk_bridge with two targets more: of a structure that is not there, and of another CT."""
        parameters = yaml.safe_load((PROJECT / "config/nodes/crtk_bridge.yaml").read_text())
        parameters["targets"]["calyx"] = {"surface": "calyx"}
        parameters["targets"]["of_another_ct"] = {"point": [0.1, 0.2, 0.3], "ct_crc32": "4294967295"}
        file = self.folder / "crtk_bridge.yaml"
        file.write_text(yaml.safe_dump(parameters))
        return file

    def start(self):
        self.system.start_master()
        self.system.start("nodes", "roslaunch", PACKAGE, "integration.launch", "policy:=auto", "score:=true",
                          "simulated_time:=true", f"robot_description:={self.case.robot_folder / 'robot.urdf'}",
                          f"images:={self.case.robot_folder / 'images.yaml'}", f"crtk:={self.crtk()}", f"ct:={self.case.ct}",
                          *self.case.launch_arguments())
        self.system.client("ready")

    def register(self):
        self.system.play_bag(self.bag, "--keep-alive")
        self.system.client("acquired", self.case.start_s)
        self.system.client("initial", self.case.start_off())
        answer = run(["rosservice", "call", "/register"], self.system.environment)
        self.assertTrue(answer.startswith("success: True"), answer[:2000])
        print(self.system.client("ct_in_tf", self.case.case / "targets_ct.csv"))

    def recorded(self, bag, *topics):
        """Plays the video of a bag; messages of these topics meanwhile, by topic. Somebody looks at the overlays."""
        topics = (*topics, "/overlay/left/image", "/overlay/right/image", "/overlay_error/image")
        self.system.stop("player")
        name = f"recorder_{len(list(self.folder.glob('recorder_*.bag')))}"
        file = self.folder / f"{name}.bag"
        self.system.start("recorder", "rosbag", "record", "--quiet", "--output-name", str(file), *topics,
                          f"__name:={name}")
        run([*overlay_case.OVERLAY_ERROR, "play", str(bag), "--duration", "4", "--listener", f"/{name}"],
            self.system.environment)
        self.system.stop("recorder")
        # The recorder itself outlives its parent, which was stopped; it gives the file its name in the end.
        wait_for(file.exists, "the recorded bag")
        found = {topic: [] for topic in topics}
        with rosbag.Bag(str(file)) as messages:
            for topic, message, _ in messages.read_messages():
                found[topic].append(message)
        return found

    def overlay_is_as_far_off_as_predicted(self):
        measures = overlay_case.measure(self.system, "--truth", self.case.robot_folder / "truth.tfm")
        self.assertEqual(measures["images"], 3)
        # 5 px are about 1 mm here. The middle of the drawn region lies where the registration's error predicts it.
        self.assertLess(measures["unexplained_px"], 1.0)
        self.assertLess(measures["displacement_mm"], 2.0)
        self.assertLess(measures["outline_mm"], 2.0)

    def targets_and_diagnostics_are_right(self):
        found = self.recorded(self.bag, "/targets/tumour/measured_cp", "/targets/calyx/measured_cp",
                              "/targets/of_another_ct/measured_cp", "/diagnostics", "/overlay/status")
        self.assertTrue(found["/targets/tumour/measured_cp"])
        T_arm_base = numpy.linalg.inv(Robot(self.case.robot_folder / "robot.urdf").pose("robot_base", "PSM1_base"))
        truth_m = moved(T_arm_base, moved(self.case.T_base_ct(), tumour_points(self.case.case)) / MM_PER_M).mean(axis=0)
        for target in found["/targets/tumour/measured_cp"]:
            self.assertEqual(target.header.frame_id, "PSM1_base")
            apart_mm = numpy.linalg.norm(position_mm(target.pose.position) - MM_PER_M * truth_m)
            self.assertLess(apart_mm, 1.5)
        print(f"the tumour, for PSM1, is {apart_mm:.2f} mm off")
        # Both eyes were drawn.
        drawn = {status.header.frame_id for status in found["/overlay/status"] if status.state == OverlayStatus.DRAWN}
        self.assertEqual(drawn, {"endoscope_left_optical", "endoscope_right_optical"})
        arms = {s.name.split(": ")[1]: s for m in found["/diagnostics"] for s in m.status if "crtk_bridge" in s.name}
        self.assertEqual(set(arms), {"ECM", "PSM1", "targets"})
        # A target that is not there is named, and leaves the others alone.
        self.assertFalse(found["/targets/calyx/measured_cp"])
        self.assertIn("'surface' is 'calyx', which ct/surface does not have", arms["targets"].message)
        self.assertFalse(found["/targets/of_another_ct/measured_cp"])
        self.assertIn("'ct_crc32' is 4294967295, but the CT that was aligned has", arms["targets"].message)
        for arm in ARMS:
            self.assertEqual(level_of(arms[arm]), OK, arms[arm].message)
            values = {v.key: v.value for v in arms[arm].values}
            self.assertLess(float(values["measured_cp from joints and model (mm)"]), 0.001)

    def video_with_wrong_kinematics(self):
        """The bag's video, later. The endoscope's insertion has another name at first, and then measured_cp is that of an
        endoscope that is 5 mm longer than the model's. Another arm has poses alone, as robots before CRTK 1.2 send them, and a third one
        sends what is no pose."""
        later, file = rospy.Duration(100.0), self.folder / "wrong.bag"
        with rosbag.Bag(str(self.bag)) as read, rosbag.Bag(str(file), "w") as wrong:
            video = next(t for _, _, t in read.read_messages("/endoscope/left/camera_info"))
            for topic, message, t in read.read_messages(start_time=video - rospy.Duration(2.5)):
                message.header.stamp += later
                if topic == "/ECM/measured_js" and t < video + rospy.Duration(0.4):
                    message.name[2] = "insertion_joint"
                elif topic == "/ECM/measured_cp":
                    message.pose.position.z += 0.005
                elif topic == "/PSM1/measured_cp":
                    wrong.write("/PSM2/measured_cp", as_transform(message, "PSM2_base"), t + later)
                    wrong.write("/PSM3/measured_cp", message.header, t + later)
                wrong.write(topic, message, t + later)
        return file

    def wrong_kinematics_are_reported_and_nothing_is_drawn(self):
        run(["rosparam", "set", "/poses/arms",
             "{PSM2: {base: PSM2_base, tip: PSM2_tool_tip}, PSM3: {base: PSM3_base, tip: PSM3_tool_tip}}"],
            self.system.environment)
        self.system.start("bridge", *roslib.packages.find_node(PACKAGE, "crtk_bridge"), "__name:=poses")
        found = self.recorded(self.video_with_wrong_kinematics(), "/overlay/status", "/overlay_error/status",
                              "/diagnostics", "/tf")
        poses = [t for m in found["/tf"] for t in m.transforms if t.child_frame_id == "PSM2_tool_tip"]
        self.assertGreater(len(poses), 100)
        self.assertEqual(poses[0].header.frame_id, "PSM2_base")
        for topic in ("/overlay/status", "/overlay_error/status"):
            self.assertTrue(found[topic])
            for status in found[topic]:
                self.assertEqual(status.state, OverlayStatus.NOTHING, status.message)
                self.assertIn("tf does not connect", status.message)
        arm = [s for m in found["/diagnostics"] for s in m.status if s.name.endswith("crtk_bridge: ECM")]
        errors = " ".join(status.message for status in arm if level_of(status) == ERROR)
        self.assertIn("has no joint 'insertion'", errors)
        self.assertIn("contradicts measured_cp", errors)
        arm = [s for m in found["/diagnostics"] for s in m.status if s.name.endswith("poses: PSM3")]
        errors = " ".join(status.message for status in arm if level_of(status) == ERROR)
        self.assertIn("PSM3/measured_cp: is a std_msgs/Header, must be a geometry_msgs/PoseStamped", errors)

    def a_wrong_hand_eye_calibration_shows_in_the_measure(self):
        """Its numbers say nothing about it. 3 mm along x are some 15 px here, which the registration does not explain."""
        T = Calibrations(PROJECT / "config/calibration/synthetic.yaml").pose("endoscope_tip", CAMERA_FRAME)
        T[:3, 3] += T[:3, 0] * 0.003
        q = quaternion_of(T[:3, :3])
        self.system.start("calibration", "rosrun", "tf2_ros", "static_transform_publisher", *map(str, T[:3, 3]),
                          *map(str, (q.x, q.y, q.z, q.w)), "endoscope_tip", CAMERA_FRAME)
        wait_for(lambda: "/static_transform_publisher" in run(["rosnode", "list"], self.system.environment),
                 "the wrong calibration")
        measures = overlay_case.measure(self.system, "--truth", self.case.robot_folder / "truth.tfm")
        self.assertAlmostEqual(measures["unexplained_px"] * measures["mm_per_px"], 3.0, delta=0.5)

    def wrong_parameters_end_the_node(self):
        arm = {"base": "PSM1_base", "tip": "PSM1_tool_tip"}
        for name, value, words in (("arms", {"PSM1": {**arm, "jonts": ["yaw"]}}, "arms/PSM1/jonts: is not a parameter"),
                                   ("arms", {"PSM1": {**arm, "joints": ["yaw"]}}, "must be those of the model"),
                                   ("arms", {"PSM1": {"base": "PSM1_base"}}, "arms/PSM1/tip: is ''"),
                                   ("targets", {"calyx": {"point": [0.1, 0.2], "ct_crc32": "7"}}, "must be a list of three numbers"),
                                   ("targets", {"calyx": {"point": [0.1, 0.2, 0]}}, "targets/calyx/ct_crc32: is ''"),
                                   ("targets", {"calyx": {"surface": ""}}, "targets/calyx/surface: is empty"),
                                   ("targets", {"calyx": {"point": [0, 1, "x"], "ct_crc32": "7"}}, "targets/calyx/point: is x, must be a number"),
                                   ("max_age", -1.0, "must be in [0.001, 60]")):
            run(["rosparam", "set", f"/wrong/{name}", yaml.safe_dump(value)], self.system.environment)
            (node,) = roslib.packages.find_node(PACKAGE, "crtk_bridge")
            ended = subprocess.run([node, "__name:=wrong"], env=self.system.environment, capture_output=True, text=True,
                                   timeout=60)
            self.assertEqual(ended.returncode, 2)
            self.assertIn(words, ended.stdout + ended.stderr)
            run(["rosparam", "delete", "/wrong"], self.system.environment)

    def test_the_whole_stack(self):
        self.start()
        self.wrong_parameters_end_the_node()
        self.register()
        self.overlay_is_as_far_off_as_predicted()
        self.targets_and_diagnostics_are_right()
        self.wrong_kinematics_are_reported_and_nothing_is_drawn()
        self.a_wrong_hand_eye_calibration_shows_in_the_measure()


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "integration", TestIntegration)
