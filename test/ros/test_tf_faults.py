#!/usr/bin/env python3
"""What a robot relies on in tf_publisher: a switch is a step, and nothing holds the broadcasts up or brings back what was
given up; tf that is disputed is not used."""
import math
import os
import pathlib
import subprocess
import sys
import time

import rospy
import rostest
import tf2_ros
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from us_ct_registration.msg import Alignment, PreScanVolume, RegistrationResult, StatusCode
from us_ct_registration.srv import Decide, LoadCt

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import PACKAGE, Newest, Process, call, wait_for
from smallest_images import ct_crc32, ultrasound
from tf_publisher_case import CT_CRC32, TOLERANCE_S, LookUps, Stamps, TfPublisherCase, clock_ms

# An fsync that takes a second, as on a slow disk.
SLOW_FSYNC = """
#include <unistd.h>
int fsync(int file) { (void)file; sleep(1); return 0; }
"""
# A CT of 8 x 8 x 8 voxels of 1 mm.
CT = (b"NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 8 8 8\n"
      b"space directions: (1,0,0) (0,1,0) (0,0,1)\nendian: little\nencoding: raw\nspace origin: (0,0,0)\n\n" + bytes(1024))
# Listeners keep transforms for this long.
MEMORY_S = 10.0
# A machine under load delivers a message this late.
LATE_S = 0.1


class TfFaults(TfPublisherCase):
    def check_what_was_reverted_does_not_come_back(self, **parameters):
        process = self.start_publisher(policy="auto", **parameters)
        self.result(1, 0.25)
        self.wait_state(Alignment.ACCEPTED, 1)
        self.assertEqual(self.decide("revert").code, StatusCode.OK)
        self.wait_state(Alignment.NONE)
        process.kill()
        # The latched result arrives again, and no file says that it was reverted.
        process = self.start_publisher(policy="auto", **parameters)
        self.assertEqual(self.wait_waiting(1).state, Alignment.NONE)
        self.assertIsNone(self.tf_at(rospy.Time.now()))
        self.assertIn("from before tf_publisher was started", process.log())
        # A clock that is ahead must not make an old result look new.
        self.ids[2] = clock_ms() + 5000
        self.result(2, 0.5)
        self.assertEqual(self.wait_waiting(2).state, Alignment.NONE)
        self.assertIn("ahead of this machine's clock", process.log())
        self.result(3, 0.5)
        self.wait_state(Alignment.ACCEPTED, 3)

    def test_what_was_reverted_does_not_come_back(self):
        self.check_what_was_reverted_does_not_come_back()

    def test_what_was_reverted_does_not_come_back_as_nodelet(self):
        self.check_what_was_reverted_does_not_come_back(as_nodelet=True)

    def timed(self, look_ups, what, x, decision):
        """Makes a decision; says how long its answer, and the first look-up that shows it, took."""
        begin = time.monotonic()
        answer = decision()
        answered = time.monotonic()
        self.assertEqual(answer.code, StatusCode.OK, answer.message)
        time.sleep(0.4)
        shown = next((when for when, seen in look_ups.seen if when > begin and seen == x), float("inf"))
        print(f"{what}: answer after {1e3 * (answered - begin):.0f} ms, look-ups at now show it after "
              f"{1e3 * (shown - begin):.0f} ms")
        # Once the caller has the answer, look-ups agree with it.
        self.assertLess(shown - answered, LATE_S)
        self.assertEqual({seen for when, seen in look_ups.seen if when > answered + LATE_S}, {x}, what)

    def check_switches(self, **parameters):
        self.start_publisher(policy="confirm", **parameters)
        look_ups, stamps = LookUps(self), Stamps(self.ct)

        def accept(number, x):
            self.result(number, x)
            self.wait_waiting(number)
            self.timed(look_ups, f"accept {x}", x, lambda: self.decide("accept", number))
        accept(1, 0.0)
        accept(2, 0.125)
        self.timed(look_ups, "revert to 0.0", 0.0, lambda: self.decide("revert"))
        self.timed(look_ups, "revert to none", None, lambda: self.decide("revert"))
        accept(3, 0.25)
        look_ups.stop()
        between = [x for _, x in look_ups.seen if x not in (None, 0.0, 0.125, 0.25)]
        print(f"{len(look_ups.seen)} look-ups at now, {len(between)} of them at a pose that was never accepted")
        self.assertFalse(between)
        # Three alignments came after another one. No time that Python can express lies in between, where tf would
        # interpolate. (On a busy machine two broadcasts of one alignment may come within a few microseconds.)
        close = [(a, b) for a, b in zip(stamps.seconds(), stamps.seconds()[1:]) if b - a < 1e-4]
        begun = [(last, first) for last, first in close if math.nextafter(last, math.inf) == first]
        self.assertEqual(len(begun), 3, close)

    def test_a_switch_is_a_switch(self):
        self.check_switches()

    def test_a_switch_is_a_switch_as_nodelet(self):
        self.check_switches(as_nodelet=True)

    def test_a_file_that_is_slow_to_write_does_not_hold_up_the_broadcasts(self):
        source, library = self.folder.name + "/fsync.c", self.folder.name + "/fsync.so"
        with open(source, "w") as stream:
            stream.write(SLOW_FSYNC)
        subprocess.run(["cc", "-shared", "-fPIC", source, "-o", library], check=True)
        self.start_publisher(policy="auto", alignment_file=self.file, environment={"LD_PRELOAD": library})
        self.result(1, 0.25)
        self.wait_tf(0.25)
        stamps = Stamps(self.ct)
        wait_for(lambda: stamps.stamps, "transforms")
        begin = time.monotonic()
        self.result(2, 0.5)
        self.wait_state(Alignment.ACCEPTED, 2)
        self.assertGreater(time.monotonic() - begin, 0.9, "the file was not written slowly")
        self.wait_tf(0.5)
        self.assertLess(stamps.longest_gap_s(), 0.5)

    def test_other_nodelets_do_not_hold_up_the_broadcasts(self):
        tolerance_s = 0.5
        self.start("manager", num_worker_threads=2)
        manager = self.namespace + "/manager"
        self.start("ct_server", manager=manager, data_root=self.folder.name, ct_frame=self.ct)
        self.start("us_cloud", manager=manager, fixed_frame=self.fixed, tf_timeout=30.0)
        self.start_publisher(manager=manager, policy="auto", transform_tolerance=tolerance_s)
        with open(self.folder.name + "/ct.nrrd", "wb") as stream:
            stream.write(CT)
        self.result(1, 0.25, ct_crc32=ct_crc32(bytes(1024)))
        self.wait_tf(0.25)
        stamps = Stamps(self.ct)
        # us_cloud waits for the pose of the ultrasound. A CT takes at least a second, since revisions are seconds.
        volumes = rospy.Publisher(self.namespace + "/us/volume", PreScanVolume, queue_size=1, latch=True)
        volumes.publish(ultrasound(self.namespace[1:] + "_lost"))
        for _ in range(3):
            answer = call(self.namespace + "/ct/load", LoadCt, "ct.nrrd", "").status
            self.assertEqual(answer.code, StatusCode.OK, answer.message)
        self.assertGreater(len(stamps.stamps), 10)
        self.assertLess(stamps.longest_gap_s(), tolerance_s)

    def wait_heard(self, broadcaster):
        """Waits until tf_publisher, beside this process, is connected to a broadcaster of this process."""
        wait_for(lambda: broadcaster.pub_tf.get_num_connections() >= 2, "tf_publisher to listen")
        time.sleep(0.3)

    def foreign(self, parent, child, x=9.0):
        transform = TransformStamped(child_frame_id=child)
        transform.header.stamp, transform.header.frame_id = rospy.Time.now(), parent
        transform.transform.translation.x = x
        transform.transform.rotation.w = 1.0
        return transform

    def test_another_publisher_suspends_it_until_a_person_decides(self):
        self.start_publisher(policy="auto")
        other = tf2_ros.TransformBroadcaster()
        self.wait_heard(other)
        self.result(1, 0.25)
        self.wait_tf(0.25)
        other.sendTransform(self.foreign(self.fixed, self.ct))
        heard = time.monotonic()
        message = self.wait_state(Alignment.NONE)
        self.assertIn("suspended", message.message)
        self.assertIn(rospy.get_name(), message.message)
        self.diagnosis(lambda s: s.level == DiagnosticStatus.ERROR and rospy.get_name() in s.message, "an error")
        # Neither a new result nor a person brings it back while listeners have the other's transforms.
        self.result(2, 0.5)
        self.assertEqual(self.wait_waiting(2).state, Alignment.NONE)
        answer = self.decide("accept")
        self.assertEqual(answer.code, StatusCode.INVALID_REQUEST)
        self.assertIn(rospy.get_name(), answer.message)
        wait_for(lambda: time.monotonic() > heard + MEMORY_S + 0.5, "the other to be forgotten")
        self.assertEqual(self.alignment.message.state, Alignment.NONE)
        self.assertEqual(self.decide("accept", 2).code, StatusCode.OK)
        self.wait_state(Alignment.ACCEPTED, 2)
        # A second parent is noticed as well.
        other.sendTransform(self.foreign(self.namespace[1:] + "_table", self.ct))
        self.assertIn("one parent", self.wait_state(Alignment.NONE).message)

    def test_a_restart_does_not_end_a_suspension(self):
        parameters = {"policy": "auto", "restore": "same_ct", "alignment_file": self.file}
        process = self.start_publisher(**parameters)
        self.hold_ct(CT_CRC32)
        other = tf2_ros.TransformBroadcaster()
        self.wait_heard(other)
        self.result(1, 0.25)
        self.wait_tf(0.25)
        other.sendTransform(self.foreign(self.fixed, self.ct))
        self.wait_state(Alignment.NONE)
        wait_for(lambda: rospy.get_name() in pathlib.Path(self.file).read_text(), "the suspension to be stored")
        process.kill()
        # The process that is started again has not heard the other publisher.
        self.start_publisher(**parameters)
        message = self.alignment.wait(lambda m: "suspended" in m.message, "the suspension")
        self.assertEqual(message.state, Alignment.NONE)
        self.assertEqual(self.decide_on_kept("accept").code, StatusCode.OK)
        self.wait_state(Alignment.RESTORED)

    def test_a_second_one_in_the_same_process_does_not_take_the_frame(self):
        self.start("manager")
        manager, second = self.namespace + "/manager", self.namespace + "/second"
        self.start_publisher(manager=manager, policy="auto")
        self.result(1, 0.25)
        self.wait_tf(0.25)
        results = rospy.Publisher(second + "/registration/result", RegistrationResult, queue_size=1, latch=True)
        alignment = Newest(second + "/registration/alignment", Alignment)
        self.processes.append(Process("tf_publisher", second, self.folder.name + "/log", manager=manager, policy="auto"))
        alignment.wait(lambda m: True, "the second to start")
        time.sleep(0.5)  # it hears the first meanwhile
        results.publish(self.registered(2, 0.5))
        self.assertEqual(alignment.wait(lambda m: m.waiting_id, "its result to wait").state, Alignment.NONE)
        answer = call(second + "/registration/accept", Decide, 0).status
        self.assertEqual(answer.code, StatusCode.INVALID_REQUEST)
        self.assertIn("as well", answer.message)
        self.wait_tf(0.25)
        self.assertEqual(self.alignment.message.state, Alignment.ACCEPTED)

    def test_what_is_shown_ends_with_its_publisher(self):
        self.start("us_cloud", fixed_frame=self.fixed, diagnostic_period=0.1)

        def wait_for_cloud(level, condition, what):
            self.diagnosis(lambda s: "us_cloud" in s.name and s.level == level and condition(s), what)
        process = self.start_publisher(policy="auto")
        self.result(1, 0.25)
        wait_for_cloud(DiagnosticStatus.OK, lambda s: any("is broadcast" in one.value for one in s.values), "an alignment")
        process.kill()
        wait_for_cloud(DiagnosticStatus.WARN, lambda s: "tf does not connect" in s.message, "it to be missed")
        self.start_publisher(policy="auto")
        self.result(2, 0.25)
        self.wait_state(Alignment.ACCEPTED, 2)
        wait_for_cloud(DiagnosticStatus.OK, lambda s: True, "it to be in force again")

    def test_what_waits_is_not_shown_in_a_frame_that_is_in_use(self):
        self.start_publisher(policy="confirm", proposed_frame=self.ct)
        self.result(1, 0.25)
        self.wait_waiting(1)
        self.assertEqual(self.decide("accept", 1).code, StatusCode.OK)
        self.wait_tf(0.25)
        look_ups = LookUps(self)
        self.result(2, 9.0)
        self.wait_waiting(2)
        time.sleep(0.5)
        look_ups.stop()
        self.assertEqual({x for _, x in look_ups.seen}, {0.25})

    def test_what_waits_leaves_its_frame_to_another_publisher(self):
        self.start_publisher(policy="confirm")
        other = tf2_ros.TransformBroadcaster()
        self.wait_heard(other)
        self.result(1, 0.25)
        self.wait_proposed(1, 0.25)
        other.sendTransform(self.foreign(self.fixed, self.proposed))
        wait_for(lambda: self.tf_at(rospy.Time.now(), self.proposed) is None, "the proposed frame to end")
        self.assertEqual(self.decide("accept", 1).code, StatusCode.OK)
        self.wait_tf(0.25)

    def test_a_loop_is_refused(self):
        self.start_publisher(policy="confirm")
        static = tf2_ros.StaticTransformBroadcaster()
        above = self.namespace[1:] + "_above"
        static.sendTransform([self.foreign(self.ct, above), self.foreign(above, self.fixed)])
        self.wait_heard(static)
        self.result(1, 0.25)
        self.wait_waiting(1)
        answer = self.decide("accept", 1)
        self.assertEqual(answer.code, StatusCode.INVALID_REQUEST)
        self.assertIn("loop", answer.message)
        self.assertIn(above, answer.message)
        self.assertEqual(self.alignment.message.state, Alignment.NONE)

    def test_the_launch_file_names_the_frames(self):
        dumped = subprocess.run(["roslaunch", "--dump-params", PACKAGE, "registration.launch", "ct_frame:=a_ct",
                                 "us_frame:=a_us", "acquired_frame:=a_acquired", "field_frame:=a_field",
                                 "proposed_frame:=a_proposed", "run_us_cloud:=true"], capture_output=True, text=True,
                                check=True)
        parameters = yaml.safe_load(dumped.stdout)
        for name, value in (("/ct_server/ct_frame", "a_ct"), ("/us_ingest/frame_id", "a_us"),
                            ("/us_cloud/acquired_frame", "a_acquired"), ("/us_cloud/field_frame", "a_field"),
                            ("/tf_publisher/proposed_frame", "a_proposed")):
            self.assertEqual(parameters[name], value, name)

    def test_stamps_on_simulated_time(self):
        self.listener.unregister()  # it would complain about the jump of time
        rospy.set_param("/use_sim_time", True)
        clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self.start_publisher(policy="auto", transform_tolerance=TOLERANCE_S)
        stamps = Stamps(self.ct)
        self.result(1, 0.25)
        # The clock is as slow as the broadcasts, and runs for three seconds.
        start_ns = 1_790_000_000_000_000_000
        ticks = [start_ns + 100_000_000 * i for i in range(30)]
        wait_for(lambda: clock.get_num_connections() > 0, "the node to hear the clock")
        for tick in ticks:
            clock.publish(Clock(rospy.Time(tick // 10**9, tick % 10**9)))
            time.sleep(0.1)
        running = list(stamps.stamps)
        time.sleep(3.0)
        standing = stamps.stamps[len(running):]
        self.assertGreater(len(running), 15)
        self.assertGreaterEqual(len(standing), 1, "late subscribers must get it while the clock stands")
        post_dated = {tick + round(1e9 * TOLERANCE_S) for tick in ticks}
        # The first is not post-dated.
        self.assertFalse(set(running[1:]) - post_dated, "repetitions while the clock runs")
        seconds = stamps.seconds()
        self.assertEqual(len(set(seconds)), len(seconds), "TF_REPEATED_DATA")


if __name__ == "__main__":
    rospy.init_node("test_tf_faults")
    rostest.rosrun(PACKAGE, "tf_faults", TfFaults)
