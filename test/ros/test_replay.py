#!/usr/bin/env python3
"""The whole system from outside: a bag of files, replayed on simulated time through all nodes, registered by an empty
call, the CT looked up in tf by another process; through restarts of every node and of the master."""
import atexit
import functools
import gzip
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

import numpy
import rosbag
import rosunit
import yaml
from us_ct_registration.msg import StatusCode
from visualization_msgs.msg import Marker

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(PROJECT / "scripts"))
import live_video
import node_under_test
from node_under_test import PACKAGE, free_port

CLIENT = [sys.executable, str(PROJECT / "scripts/demo_client.py")]
LIMIT_S = 180.0
NODES = ("us_ingest", "ct_server", "registration", "tf_publisher")
# Poses in the fixed frame; the patient was turned and moved in between.
POSES = ("-1.4 0.1 0.3 420 -130 250", "-1.38 0.12 0.28 424 -127 247")
# A kidney phantom in agar, small enough for tests.
AGAR = ("--scene", "agar", "--seed", "3", "--size", "120", "64", "41")
# The same by a tracked probe, as captured video has it: every seventh image is the one before.
LAG_S = 0.2
TRACKED = ("--scene", "agar", "--seed", "3", "--sweep", "tracked-curvilinear", "--size", "120", "64", "80",
           "--frame-rate", "20", "--lag", str(LAG_S), "--duplicates", "0.15")

wait_for = functools.partial(node_under_test.wait_for, limit_s=LIMIT_S)


def run(command, environment, succeeds=True):
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=2 * LIMIT_S)
    if succeeds and done.returncode != 0:
        raise AssertionError(f"{command} ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def usct():
    for folder in os.environ["CMAKE_PREFIX_PATH"].split(":"):
        for place in ("lib/us_ct_registration/usct", "bin/usct"):
            if os.access(f"{folder}/{place}", os.X_OK):
                return f"{folder}/{place}"
    raise AssertionError("usct is not below CMAKE_PREFIX_PATH")


def pids_of_node(name, environment):
    """Processes of that name with this test's master; other tests on the machine may have such nodes as well."""
    found = []
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            arguments = (process / "cmdline").read_bytes().split(b"\0")
            variables = (process / "environ").read_bytes().split(b"\0")
        except OSError:
            continue
        if f"__name:={name}".encode() in arguments and \
                f"ROS_MASTER_URI={environment['ROS_MASTER_URI']}".encode() in variables:
            found.append(int(process.name))
    return found


class Recording:
    """Bags of a file of ultrasound, each later than the last: ultrasound that is older than the CT is refused."""

    def __init__(self, folder, ct, *bag_options):
        self.folder, self.ct, self.bag_options = folder, ct, bag_options
        self.start_s = 0

    def next_bag(self, pose, pause_s=60):
        """Writes a bag with the probe at POSES[pose], 1000 s after the previous bag."""
        self.start_s += 1000
        file = self.folder / "pose.tfm"
        file.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                        f"Parameters: {POSES[pose]}\nFixedParameters: 0 0 0 0\n")
        bag = self.folder / f"{self.start_s}.bag"
        run([usct(), "bag", "write", *map(str, self.bag_options), "--fixed-pose", str(file), "--start",
             str(self.start_s), "--frame-rate", "40", "--pause", str(pause_s), "--output", str(bag)], None)
        return bag


@functools.lru_cache(maxsize=None)
def case_of(*phantom):
    """The folder of a phantom, which is made once in a process: all tests that ask for it share it."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_phantom_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    run([usct(), "phantom", "--output", str(folder / "case"), "--quiet", *phantom], None)
    return folder / "case"


class Acquisition(Recording):
    """A phantom, and a start that is off by shift_mm along each axis."""

    def __init__(self, folder, phantom=AGAR, shift_mm=5.0, ct=None):
        self.case = case_of(*map(str, phantom))
        super().__init__(folder, ct or self.case / "ct.nrrd", "--us", self.case / "us.nrrd", "--truth",
                         self.case / "truth.tfm")
        numbers = (self.case / "truth.tfm").read_text()
        start = re.sub(r"^Parameters: (.*)$", lambda line: "Parameters: " + shifted(line.group(1), shift_mm), numbers,
                       flags=re.M)
        (folder / "start.tfm").write_text(start)
        self.initial = initial_of(folder / "start.tfm")


class LivePhantom(Acquisition):
    """A phantom as live video: bags of its pictures, scan-converted, and of the poses of its probe."""

    def __init__(self, folder):
        folder.mkdir()
        super().__init__(folder, TRACKED)
        self.sweep = live_video.Sweep(self.case / "us.nrrd")
        self.probe = live_video.PicturedProbe(self.sweep, folder / "probe.yaml")
        self.pictures = [self.probe.picture(frame) for frame in self.sweep.samples]
        self.truth = numpy.array(json.loads(description_of(self.case / "truth.tfm"))["T_us_ct"])

    def described(self):
        return live_video.describe(self.folder / "images.yaml", self.probe, self.pictures[0], image_lag=LAG_S)

    def next_bag(self, pose, pause_s=60):
        self.start_s += 1000
        bag = self.folder / f"{self.start_s}.bag"
        live_video.write(bag, self.pictures, [self.start_s + time_s for time_s in self.sweep.times_s],
                         self.sweep.T_us_frame, live_video.matrix_of_euler(POSES[pose]), pause_s, self.truth)
        return bag


def description_of(transform):
    """What `usct info` says of an ITK transform, as JSON."""
    return run([usct(), "info", "--json", str(transform)], None)


def initial_of(transform):
    """An ITK transform in the format of demo_client.py."""
    initial = transform.with_suffix(".json")
    initial.write_text(description_of(transform))
    return initial


def reversed_lines(ultrasound, mirrored):
    """The ultrasound with its lines in reverse order, as of a probe that was held the wrong way round."""
    header, voxels = ultrasound.read_bytes().split(b"\n\n", 1)
    sizes = [int(size) for size in re.search(rb"^sizes: (.*)$", header, re.M).group(1).split()]
    if b"encoding: gzip" in header:
        header, voxels = header.replace(b"encoding: gzip", b"encoding: raw"), gzip.decompress(voxels)
    lines = numpy.frombuffer(voxels, "u1").reshape(sizes[::-1])
    mirrored.write_bytes(header + b"\n\n" + lines[:, ::-1].tobytes())
    return mirrored


def shifted(parameters, shift_mm):
    numbers = [float(x) for x in parameters.split()]
    for i in (9, 10, 11):
        numbers[i] += shift_mm
    return " ".join(map(repr, numbers))


class System:
    """Master, nodes and player, as processes of their own."""

    def __init__(self, folder, acquisition):
        self.folder, self.acquisition = folder, acquisition
        self.port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{self.port}", ROS_HOSTNAME="localhost",
                                ROS_HOME=str(folder / "ros"), ROS_LOG_DIR=str(folder / "log"))
        self.environment.pop("ROS_IP", None)
        self.running = {}

    def start(self, name, *command, environment=None):
        with open(self.folder / f"{name}.log", "ab") as log:
            self.running[name] = subprocess.Popen(command, env=environment or self.environment, stdout=log,
                                                  stderr=subprocess.STDOUT)

    def stop(self, name, how=signal.SIGTERM):
        process = self.running.pop(name, None)
        if process is None:
            return
        process.send_signal(how)
        process.wait(60)

    def stop_all(self):
        for name in ("player", "nodes", "master"):
            self.stop(name)

    def start_master(self):
        # The master is started without roscore, its parent, which would leave it behind when killed.
        self.start("master", "rosmaster", "--core", "-p", str(self.port))
        wait_for(lambda: subprocess.run(["rosparam", "list"], env=self.environment, capture_output=True).returncode == 0,
                 "the master")
        run(["rosparam", "set", "use_sim_time", "true"], self.environment)

    def start_nodes(self, *arguments):
        self.start("nodes", "roslaunch", PACKAGE, "registration.launch", "fixed_frame:=patient", "policy:=auto",
                   "preset:=phantom", "respawn:=true", "restore:=same_ct", f"ct:={self.acquisition.ct}",
                   f"alignment_file:={self.folder / 'alignment.json'}", *arguments)

    def play(self, pose):
        """Replays the next acquisition and waits for its volume; the previous one may still be latched."""
        self.play_bag(self.acquisition.next_bag(pose), "--keep-alive")
        self.client("acquired", self.acquisition.start_s)

    def play_bag(self, bag, *options):
        """Replays a bag from its first message on, to all who listen by then."""
        self.stop("player")
        self.start("player", "rosbag", "play", "--clock", "--quiet", "--pause", *options, str(bag), "__name:=player")
        self.client("go_on", "/player")

    def client(self, *arguments):
        return run([*CLIENT, *map(str, arguments)], self.environment)

    def log(self):
        return "\n".join(f"{path.name}:\n{path.read_text(errors='replace')[-5000:]}"
                         for path in sorted(self.folder.glob("*.log")))


class TestReplay(unittest.TestCase):
    nodelet = "false"

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_replay_"))
        self.acquisition = Acquisition(self.folder)
        self.system = System(self.folder, self.acquisition)

    def tearDown(self):
        self.system.stop_all()
        if node_under_test.has_failed(self):
            print(self.system.log())
        shutil.rmtree(self.folder)

    def ct_in_tf(self):
        """Looks the CT up in tf in another process; fails unless it is within 2 mm of the truth."""
        print(self.system.client("ct_in_tf", self.acquisition.case / "targets_ct.csv"))

    def acquire_and_register(self, pose):
        """The operator's part: an acquisition, and an empty call of /register."""
        self.system.play(pose)
        self.system.client("initial", self.acquisition.initial)
        answer = run(["rosservice", "call", "/register"], self.system.environment)
        self.assertTrue(answer.startswith("success: True"), answer[:2000])
        self.ct_in_tf()

    def test_acquisitions_in_a_row_and_a_probe_that_moves_away(self):
        self.system.start_master()
        self.system.start_nodes()
        self.system.client("ready")
        for pose in range(len(POSES)):
            self.acquire_and_register(pose)
            self.system.client("moved_away", 99)
            self.ct_in_tf()

    def test_live_images_of_a_tracked_probe(self):
        self.acquisition = LivePhantom(self.folder / "live")
        self.system = System(self.folder, self.acquisition)
        self.system.start_master()
        self.system.start_nodes(self.acquisition.described())
        self.system.client("ready")
        self.acquire_and_register(0)

    def test_nodelets_in_one_process(self):
        self.system.start_master()
        self.system.start_nodes("nodelet:=true", f"data_root:={self.acquisition.case}")
        self.system.client("ready")
        self.acquire_and_register(0)
        self.register_in_loops()

    def register_in_loops(self):
        """A CT that is loaded in one loop of a bag, after the sweep, is there in all loops that follow."""
        def code():
            answer = yaml.safe_load(run(["rosservice", "call", "/register"], self.system.environment))
            return answer["result"]["status"]["code"]
        self.system.play_bag(self.acquisition.next_bag(0, pause_s=5), "-l")
        self.system.client("acquired", self.acquisition.start_s)
        self.system.client("next_loop", "/player")
        # Another CT than the one before, which would keep its stamp, and whose alignments do not hold for it.
        for call in (("/ct/roi", "{decimation: 2}"), ("/ct/load", "ct.nrrd", "")):
            run(["rosservice", "call", *call], self.system.environment)
        wait_for(lambda: code() == StatusCode.ULTRASOUND_OUTDATED, "the new CT")
        self.system.client("initial", self.acquisition.initial)
        for _ in range(2):
            self.system.client("next_loop", "/player")
            self.assertIn(code(), (StatusCode.REGISTERED, StatusCode.LOW_CONFIDENCE))

    def drawn(self, topic):
        """The newest message of a topic of us_cloud, as a third party receives it."""
        bag = self.folder / "drawn.bag"
        run(["rosbag", "record", "--quiet", "--limit", "1", "--output-name", str(bag), topic], self.system.environment)
        with rosbag.Bag(str(bag)) as recorded:
            return next(message for _, message, _ in recorded.read_messages())

    def refused_texts(self):
        return [marker.text for marker in self.drawn("/ct/surface_refused").markers
                if marker.ns == "REFUSED" and marker.type == Marker.TEXT_VIEW_FACING]

    def test_a_refused_candidate_is_drawn_and_marked_and_not_in_tf(self):
        recorded = self.acquisition.bag_options
        mirrored = reversed_lines(self.acquisition.case / "us.nrrd", self.folder / "mirrored.nrrd")
        self.acquisition.bag_options = ("--us", mirrored)
        self.system.start_master()
        self.system.start_nodes("run_us_cloud:=true")
        self.system.client("ready")
        self.system.play(0)
        self.system.client("initial", self.acquisition.initial)
        answer = yaml.safe_load(run(["rosservice", "call", "/register"], self.system.environment))
        result = answer["result"]
        self.assertFalse(answer["success"])
        self.assertEqual(result["status"]["code"], StatusCode.LOW_CONFIDENCE, answer["message"])
        self.assertGreater(result["wrong_probability"], 0.3)
        self.assertGreater(result["error_bound"], result["expected_error"])
        self.assertGreater(result["expected_error"], 0)
        title, reason = wait_for(self.refused_texts, "the text that says REFUSED")
        self.assertTrue(title.startswith("REFUSED"), title)
        self.assertEqual(reason.replace("\n", " "), answer["message"])
        # The cloud is where the candidate has the CT, and has the stamp of the ultrasound.
        cloud = self.drawn("/ct/cloud_refused")
        self.assertGreater(cloud.width, 100)
        self.assertEqual(cloud.header.frame_id, "patient")
        self.assertEqual(self.drawn("/ct/cloud").width, 0)
        print(self.system.client("no_ct_in_tf"))
        # The next acquisition takes the place of the refused candidate, and is registered.
        self.acquisition.bag_options = recorded
        self.system.play(1)
        wait_for(lambda: not self.refused_texts(), "the refused candidate to disappear")
        self.assertEqual(self.drawn("/ct/cloud_refused").width, 0)
        self.system.client("initial", self.acquisition.initial)
        self.assertTrue(run(["rosservice", "call", "/register"], self.system.environment).startswith("success: True"))
        self.ct_in_tf()
        self.assertFalse(self.refused_texts())

    def test_restart_of_every_node(self):
        self.system.start_master()
        self.system.start_nodes()
        self.system.client("ready")
        for index, node in enumerate(NODES):
            self.acquire_and_register(index % 2)
            (pid,) = pids_of_node(node, self.system.environment)
            os.kill(pid, signal.SIGKILL)
            wait_for(lambda: set(pids_of_node(node, self.system.environment)) - {pid}, f"{node} to come back")
            self.system.client("ready")
            # The accepted CT is still there, or there again.
            self.ct_in_tf()
        self.acquire_and_register(0)

    def test_restart_of_the_master(self):
        self.system.start_master()
        self.system.start_nodes()
        self.system.client("ready")
        self.acquire_and_register(0)
        self.system.stop("master", signal.SIGKILL)
        # A ROS 1 node does not find a new master by itself. A new launch has the CT of the old one.
        self.system.stop("player")
        self.system.stop("nodes")
        self.system.start_master()
        self.system.start_nodes()
        self.system.client("ready")
        self.system.play(0)
        self.system.client("restored")
        self.ct_in_tf()
        self.acquire_and_register(1)


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "replay", TestReplay)
