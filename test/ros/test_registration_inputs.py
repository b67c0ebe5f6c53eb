#!/usr/bin/env python3
"""Images that reach the registration node later than a request."""
import os
import sys
import tempfile
import threading
import time
import unittest

import rospy
import rostest
from us_ct_registration.msg import CtInfo, CtVolume, PreScanVolume, StatusCode
from us_ct_registration.srv import Register, SetInitialAlignment, SetInitialAlignmentRequest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import PACKAGE, Newest, Process, call
from smallest_images import ct, info_of, ultrasound

# A message arrives within this time.
ON_ITS_WAY_S = 0.5
FIRST_CT = ct(1, 1)
SECOND_CT = ct(2, 2)


class Asking(threading.Thread):
    """A call of `register`, and the result once it has ended."""

    def __init__(self, namespace):
        super().__init__(daemon=True)
        self.namespace, self.result = namespace, None
        self.start()

    def run(self):
        self.result = call(self.namespace + "/register", Register).result

    def has_ended(self, within_s):
        self.join(within_s)
        return self.result is not None


class RegistrationInputs(unittest.TestCase):
    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        self.folder = tempfile.TemporaryDirectory()
        self.ct_info, self.ct_volume = self.latched("ct/info", CtInfo), self.latched("ct/volume", CtVolume)
        self.us_volume = self.latched("us/volume", PreScanVolume)
        self.held = Newest(self.namespace + "/registration/ct", CtInfo)
        self.processes = []

    def tearDown(self):
        for process in self.processes:
            process.kill()
        self.folder.cleanup()

    def latched(self, topic, kind):
        return rospy.Publisher(f"{self.namespace}/{topic}", kind, queue_size=1, latch=True)

    def start(self, **parameters):
        process = Process("registration", self.namespace, self.folder.name + "/log", preset="fast", **parameters)
        self.processes.append(process)
        return process

    def send_us(self):
        message = ultrasound("us_of_" + self.namespace[1:])
        self.us_volume.publish(message)
        return message

    def send_ct(self, volume):
        self.ct_volume.publish(volume)
        self.held.wait(lambda held: held.crc32 == volume.crc32, "the CT to be held")

    def set_initial(self):
        request = SetInitialAlignmentRequest(type=SetInitialAlignmentRequest.POSE)
        request.header.frame_id = "us_of_" + self.namespace[1:]
        request.transform.rotation.w = 1.0
        answer = call(self.namespace + "/registration/set_initial_alignment", SetInitialAlignment, request).status
        self.assertEqual(answer.code, StatusCode.OK, answer.message)

    def register(self):
        asking = Asking(self.namespace)
        self.assertTrue(asking.has_ended(60.0))
        return asking.result

    def test_a_ct_that_was_announced_is_waited_for(self):
        self.start()
        self.send_us()
        self.ct_info.publish(info_of(FIRST_CT))
        self.send_ct(FIRST_CT)
        self.ct_info.publish(info_of(SECOND_CT))
        time.sleep(ON_ITS_WAY_S)
        self.set_initial()
        asking = Asking(self.namespace)
        self.assertFalse(asking.has_ended(1.0), asking.result)
        self.ct_volume.publish(SECOND_CT)
        self.assertTrue(asking.has_ended(60.0))
        self.assertEqual((asking.result.ct_crc32, asking.result.initial_alignment), (SECOND_CT.crc32, "set"))

    def test_a_ct_that_nobody_announces_is_used_at_once(self):
        self.start()
        self.send_us()
        self.ct_info.publish(info_of(FIRST_CT))
        self.send_ct(FIRST_CT)
        time.sleep(ON_ITS_WAY_S)
        self.set_initial()
        self.send_ct(SECOND_CT)
        result = self.register()
        self.assertEqual((result.ct_crc32, result.status.code), (SECOND_CT.crc32, StatusCode.NO_INITIAL_ALIGNMENT))


if __name__ == "__main__":
    rospy.init_node("test_registration_inputs")
    rostest.rosrun(PACKAGE, "registration_inputs", RegistrationInputs)
