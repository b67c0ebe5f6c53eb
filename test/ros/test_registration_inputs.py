#!/usr/bin/env python3
"""Images that reach the registration node later than a request, and those that reach it again after a restart."""
import os
import sys
import tempfile
import threading
import time
import unittest

import rospy
import rostest
from us_ct_registration.msg import Alignment, CtInfo, CtVolume, PreScanVolume, RegistrationResult, StatusCode
from us_ct_registration.srv import Register, SetInitialAlignment, SetInitialAlignmentRequest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import PACKAGE, Newest, Process, call, wait_for
from smallest_images import ct, info_of, ultrasound

# A message arrives within this time.
ON_ITS_WAY_S = 0.5
# Longer than a continuous registration of the smallest images takes to be published, and to begin after a start.
QUIET_S = 4.0
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
        self.alignment = self.latched("registration/alignment", Alignment)
        self.held = Newest(self.namespace + "/registration/ct", CtInfo)
        self.results = []
        self.subscriber = rospy.Subscriber(self.namespace + "/registration/result", RegistrationResult,
                                           self.results.append, queue_size=100)
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

    def test_ultrasound_that_comes_before_the_ct_is_registered_with_it(self):
        self.start(continuous=True)
        us = self.send_us()
        time.sleep(QUIET_S)
        self.assertEqual([result.status.message for result in self.results], [])
        self.send_ct(FIRST_CT)
        wait_for(lambda: self.results, "its registration")
        self.assertEqual((self.results[0].us_stamp, self.results[0].ct_crc32), (us.header.stamp, FIRST_CT.crc32))

    def aligned(self, us):
        """What tf_publisher says once a result of this ultrasound was accepted."""
        message = Alignment(state=Alignment.ACCEPTED, ct_frame="ct", ct_crc32=FIRST_CT.crc32, policy="auto", result_id=7)
        message.header.stamp, message.header.frame_id = us.header.stamp, self.namespace[1:] + "_base"
        message.transform.rotation.w = 1.0
        return message

    def test_what_was_registered_before_a_restart_is_not_registered_again(self):
        parameters = {"continuous": True, "fixed_frame": self.namespace[1:] + "_base", "tf_timeout": 0.1}
        process = self.start(**parameters)
        first = self.send_us()
        self.send_ct(FIRST_CT)
        wait_for(lambda: self.results, "its registration")
        self.alignment.publish(self.aligned(first))
        process.kill()
        self.results.clear()
        # All these come again, and tf knows nothing of the time of the ultrasound.
        self.held.message = None
        self.start(**parameters)
        self.held.wait(lambda held: held.crc32 == FIRST_CT.crc32, "the CT to be held")
        time.sleep(QUIET_S)
        self.assertEqual([result.status.message for result in self.results], [])
        second = self.send_us()
        wait_for(lambda: self.results, "the registration of the next ultrasound")
        self.assertEqual(self.results[0].us_stamp, second.header.stamp)

    def test_what_came_while_the_node_was_away_is_registered(self):
        self.alignment.publish(self.aligned(ultrasound("us")))
        time.sleep(0.01)
        us = self.send_us()
        self.start(continuous=True)
        self.send_ct(FIRST_CT)
        wait_for(lambda: self.results, "its registration")
        self.assertEqual(self.results[0].us_stamp, us.header.stamp)


if __name__ == "__main__":
    rospy.init_node("test_registration_inputs")
    rostest.rosrun(PACKAGE, "registration_inputs", RegistrationInputs)
