"""A tf_publisher under test, the results that it gets, and the transforms in tf."""
import os
import sys
import tempfile
import threading
import time
import unittest

import rospy
import tf2_msgs.msg
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Transform
from us_ct_registration.msg import Alignment, CtInfo, RegistrationResult, StatusCode
from us_ct_registration.srv import Decide, DecideRequest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import Newest, Process, call, wait_for

TOLERANCE_S = 0.2
CT_CRC32 = 1234567
OTHER_CT_CRC32 = 7654321


def clock_ms():
    return time.time_ns() // 1_000_000


class LookUps(threading.Thread):
    """Looks the CT up at the present time, all the time: x, or None if there is none, with the time in s."""

    def __init__(self, test):
        super().__init__(daemon=True)
        self.test, self.ended, self.seen = test, False, []
        self.start()

    def run(self):
        while not self.ended:
            transform = self.test.tf_at(rospy.Time.now())
            self.seen.append((time.monotonic(), transform and round(transform.translation.x, 9)))
            time.sleep(0.0005)

    def stop(self):
        self.ended = True
        self.join()


class Stamps:
    """Stamps of all transforms to a frame, ns, as they are sent."""

    def __init__(self, frame):
        self.frame, self.stamps = frame, []
        self.subscriber = rospy.Subscriber("/tf", tf2_msgs.msg.TFMessage, self.take, queue_size=1000)

    def take(self, message):
        self.stamps += [one.header.stamp.to_nsec() for one in message.transforms if one.child_frame_id == self.frame]

    def seconds(self):
        """The stamps as Python's listeners keep them: double numbers, as of genpy's to_sec."""
        return [ns // 10**9 + ns % 10**9 / 1e9 for ns in self.stamps]

    def longest_gap_s(self):
        return max(b - a for a, b in zip(self.stamps, self.stamps[1:])) / 1e9


class TfPublisherCase(unittest.TestCase):
    # Stamp of the ultrasound of result 0; each later one is a second later.
    first_stamp_s = 1000

    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        # All namespaces share one tf, so that each test has frames of its own.
        self.fixed = self.namespace[1:] + "_base"
        self.ct = self.namespace[1:] + "_ct"
        self.proposed = self.namespace[1:] + "_proposed"
        self.folder = tempfile.TemporaryDirectory()
        self.file = os.path.join(self.folder.name, "alignment.json")
        self.buffer = tf2_ros.Buffer()
        self.listener = tf2_ros.TransformListener(self.buffer)
        self.results = rospy.Publisher(self.namespace + "/registration/result", RegistrationResult,
                                       queue_size=10, latch=True)
        self.info = rospy.Publisher(self.namespace + "/ct/info", CtInfo, queue_size=1, latch=True)
        self.registered_ct = rospy.Publisher(self.namespace + "/registration/ct", CtInfo, queue_size=1, latch=True)
        self.alignment = Newest(self.namespace + "/registration/alignment", Alignment)
        self.proposal = Newest(self.namespace + "/registration/proposed", Alignment)
        self.processes = []
        self.ids = {}

    def tearDown(self):
        for process in self.processes:
            process.kill()
        rospy.set_param("/use_sim_time", False)
        self.folder.cleanup()

    def start(self, kind="tf_publisher", **parameters):
        process = Process(kind, self.namespace, self.folder.name + "/log", **parameters)
        self.processes.append(process)
        return process

    def start_publisher(self, **parameters):
        self.alignment.message = None
        parameters = {"transform_tolerance": TOLERANCE_S, "proposed_frame": self.proposed, **parameters}
        process = self.start(**parameters)
        wait_for(lambda: self.alignment.message, "tf_publisher to start")
        return process

    def id_of(self, number):
        """The id of the result that the test calls by a small number."""
        if number not in self.ids:
            time.sleep(0.002)
            self.ids[number] = clock_ms()
        return self.ids[number]

    def registered(self, number, x):
        message = RegistrationResult()
        message.header.stamp = rospy.Time(self.first_stamp_s + number)
        message.id = self.id_of(number)
        message.status.code = StatusCode.REGISTERED
        message.ct_frame = self.ct
        message.ct_crc32 = CT_CRC32
        message.fixed_frame = self.fixed
        message.fixed_transform.translation.x = x
        message.fixed_transform.rotation.z = 0.6
        message.fixed_transform.rotation.w = 0.8
        return message

    def result(self, number, x, code=StatusCode.REGISTERED, **fields):
        message = self.registered(number, x)
        if code != StatusCode.REGISTERED:
            message.status.code, message.fixed_frame, message.fixed_transform = code, "", Transform()
        for name, value in fields.items():
            setattr(message, name, value)
        self.results.publish(message)

    def ct_info(self, crc32, frame=None):
        message = CtInfo(crc32=crc32)
        message.header.frame_id = frame or self.ct
        return message

    def hold_ct(self, crc32, frame=None):
        self.info.publish(self.ct_info(crc32, frame))

    def decide(self, verb, number=0):
        return call(f"{self.namespace}/registration/{verb}", Decide, self.ids.get(number, number)).status

    def decide_on_kept(self, verb):
        return call(f"{self.namespace}/registration/{verb}", Decide, DecideRequest.KEPT).status

    def wait_state(self, state, result_id=None):
        return self.alignment.wait(
            lambda m: m.state == state and (result_id is None or m.result_id == self.id_of(result_id)),
            f"state {state}")

    def wait_waiting(self, number):
        return self.alignment.wait(lambda m: m.waiting_id == self.id_of(number), f"result {number} to wait")

    def tf_at(self, time, frame=None):
        try:
            return self.buffer.lookup_transform(self.fixed, frame or self.ct, time).transform
        except tf2_ros.TransformException:
            return None

    def wait_tf(self, x, frame=None):
        def found():
            transform = self.tf_at(rospy.Time.now(), frame)
            return transform and abs(transform.translation.x - x) < 1e-12
        wait_for(found, f"tf to say {x}")
        rotation = self.tf_at(rospy.Time(0), frame).rotation
        self.assertEqual((rotation.x, rotation.y, rotation.z, rotation.w), (0.0, 0.0, 0.6, 0.8))

    def wait_proposed(self, number, x):
        """The result that waits is in tf, in a frame of its own, and on its topic; the CT is not moved by it."""
        message = self.proposal.wait(lambda m: m.state == Alignment.PROPOSED and m.result_id == self.id_of(number),
                                     f"result {number} to be proposed")
        self.assertEqual((message.header.frame_id, message.ct_frame, message.waiting_id, message.ct_crc32),
                         (self.fixed, self.ct, self.id_of(number), CT_CRC32))
        self.assertEqual(message.transform.translation.x, x)
        self.wait_tf(x, self.proposed)

    def wait_nothing_proposed(self):
        self.proposal.wait(lambda m: m.state == Alignment.NONE, "nothing to be proposed")
        wait_for(lambda: self.tf_at(rospy.Time.now(), self.proposed) is None, "the proposed frame to end")

    def diagnosis(self, condition, what):
        def matching(message):
            return [s for s in message.status if s.name.startswith(self.namespace[1:])
                    and condition(s)]
        newest = Newest("/diagnostics", DiagnosticArray)
        return matching(newest.wait(matching, what))[0]
