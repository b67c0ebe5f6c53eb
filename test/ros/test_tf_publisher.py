#!/usr/bin/env python3
"""tf_publisher from outside: the transforms in tf after results, decisions, crashes and restarts."""
import os
import sys
import threading
import time

import rospy
import rostest
import std_msgs.msg
import tf2_msgs.msg
import tf2_ros
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rosgraph_msgs.msg import Clock
from us_ct_registration.msg import Alignment, StatusCode

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import Newest, wait_for
from tf_publisher_case import CT_CRC32, OTHER_CT_CRC32, TOLERANCE_S, Stamps, TfPublisherCase


class TfPublisher(TfPublisherCase):
    def check_confirm(self, **parameters):
        self.start_publisher(policy="confirm", **parameters)
        self.result(1, 0.25)
        message = self.wait_waiting(1)
        self.assertEqual(message.state, Alignment.NONE)
        self.wait_proposed(1, 0.25)
        late = Newest(self.namespace + "/registration/proposed", Alignment)
        late.wait(lambda m: m.state == Alignment.PROPOSED, "what waits, for who listens later")
        self.assertIsNone(self.tf_at(rospy.Time(0)))

        answer = self.decide("accept", 7)
        self.assertEqual(answer.code, StatusCode.INVALID_REQUEST)
        self.assertIn("result 7", answer.message)
        self.assertIn(f"result {self.id_of(1)} waits", answer.message)
        self.assertIsNone(self.tf_at(rospy.Time(0)))

        self.assertEqual(self.decide("accept", 1).code, StatusCode.OK)
        message = self.wait_state(Alignment.ACCEPTED, 1)
        self.assertEqual((message.header.frame_id, message.ct_frame), (self.fixed, self.ct))
        self.assertEqual(message.header.stamp, rospy.Time(1001))
        self.assertEqual((message.waiting_id, message.ct_crc32), (0, CT_CRC32))
        self.wait_tf(0.25)
        self.wait_nothing_proposed()
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)

    def test_confirm(self):
        self.check_confirm()

    def test_confirm_as_nodelet(self):
        self.check_confirm(as_nodelet=True)

    def test_a_decision_waits_for_a_result_that_is_on_its_way(self):
        # Who called the registration has the number of the result before the result has come on its topic.
        self.start_publisher(policy="confirm")
        wait_for(self.results.get_num_connections, "tf_publisher to listen")
        self.id_of(1)
        answers = []
        caller = threading.Thread(target=lambda: answers.append(self.decide("accept", 1)))
        caller.start()
        time.sleep(0.2)
        self.result(1, 0.25)
        caller.join()
        self.assertEqual(answers[0].code, StatusCode.OK, answers[0].message)
        self.wait_tf(0.25)
        # What never comes is answered all the same.
        self.id_of(2)
        self.assertEqual(self.decide("reject", 2).code, StatusCode.NOTHING_TO_DECIDE)

    def test_a_decision_without_a_number_is_on_what_waits_at_that_moment(self):
        """It waits for nothing. So a caller of the registration who leaves out the number of the result, and is faster
        than the result, decides on nothing, or on the result before."""
        self.start_publisher(policy="confirm")
        wait_for(self.results.get_num_connections, "tf_publisher to listen")
        # The registration has answered, and its result 1 has not come yet.
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)
        self.result(1, 0.25)
        self.wait_waiting(1)
        self.assertEqual(self.alignment.message.state, Alignment.NONE)
        # The same of result 2, while nobody has decided on result 1: the one that is accepted is in the answer.
        answer = self.decide("accept")
        self.assertEqual(answer.code, StatusCode.OK)
        self.assertIn(f"result {self.id_of(1)} is accepted", answer.message)
        self.result(2, 0.5)
        self.wait_waiting(2)
        self.wait_tf(0.25)
        # With its number, what comes too late changes nothing.
        self.result(3, 0.75)
        self.wait_waiting(3)
        self.assertEqual(self.decide("accept", 2).code, StatusCode.INVALID_REQUEST)
        self.wait_tf(0.25)

    def test_what_is_refused_or_rejected_leaves_tf_as_it_is(self):
        self.start_publisher(policy="confirm", fixed_frame=self.fixed)
        self.result(1, 0.25)
        self.wait_waiting(1)
        self.assertEqual(self.decide("accept").code, StatusCode.OK)
        self.wait_tf(0.25)
        for number, code in enumerate((StatusCode.LOW_CONFIDENCE, StatusCode.NO_OVERLAP,
                                       StatusCode.FAILED, StatusCode.CANCELLED), 2):
            self.result(number, 9.0, code)
        self.result(6, 9.0, fixed_frame=self.namespace[1:] + "_elsewhere")
        self.diagnosis(lambda s: any("_elsewhere" in v.value for v in s.values),
                       "the refusal of another fixed frame")
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)
        self.result(7, 9.0)
        message = self.wait_waiting(7)
        self.assertEqual(message.result_id, self.id_of(1))
        self.wait_proposed(7, 9.0)
        # One that is newer takes its place, as one step, and the CT stays where it is.
        self.result(8, 8.0)
        self.wait_proposed(8, 8.0)
        self.result(7, 9.0)
        self.wait_proposed(7, 9.0)
        self.wait_tf(0.25)

        answer = self.decide("reject", 6)
        self.assertEqual(answer.code, StatusCode.INVALID_REQUEST)
        self.assertIn(f"result {self.id_of(6)}", answer.message)
        self.assertIn(f"result {self.id_of(7)} waits", answer.message)
        self.assertEqual(self.decide("reject", 7).code, StatusCode.OK)
        self.assertEqual(self.decide("reject").code, StatusCode.NOTHING_TO_DECIDE)
        self.alignment.wait(lambda m: m.waiting_id == 0 and m.result_id == self.id_of(1), "none to wait")
        self.wait_nothing_proposed()
        self.wait_tf(0.25)

    def test_results_from_the_future_are_refused(self):
        self.start_publisher(policy="auto")
        now = rospy.Time.now()
        for number, field in enumerate(("header.stamp", "us_stamp"), 1):
            for stamp in (now + rospy.Duration(3600), rospy.Time(4294967200)):
                message = self.registered(number, 9.0)
                if field == "us_stamp":
                    message.us_stamp = stamp
                else:
                    message.header.stamp = stamp
                self.results.publish(message)
                self.diagnosis(lambda s: any(v.key == "last refusal" and f"result {self.id_of(number)}" in v.value and
                                             f"'{field}'" in v.value and "ahead of this node's clock" in v.value
                                             for v in s.values), f"the refusal of {field}")
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)
        self.assertIsNone(self.tf_at(rospy.Time(0)))
        # Clocks of two machines may differ by some seconds.
        message = self.registered(3, 0.25)
        message.header.stamp = message.us_stamp = rospy.Time.now() + rospy.Duration(10)
        self.results.publish(message)
        self.wait_state(Alignment.ACCEPTED, 3)
        self.wait_tf(0.25)

    def test_auto_and_revert(self):
        self.start_publisher(policy="auto")
        self.result(1, 0.25)
        self.wait_state(Alignment.ACCEPTED, 1)
        self.result(2, 0.5)
        self.wait_state(Alignment.ACCEPTED, 2)
        self.wait_tf(0.5)
        answer = self.decide("revert")
        self.assertEqual(answer.code, StatusCode.OK)
        self.assertIn(f"result {self.id_of(1)} is broadcast", answer.message)
        self.wait_state(Alignment.ACCEPTED, 1)
        self.wait_tf(0.25)
        self.assertEqual(self.decide("revert").code, StatusCode.OK)
        self.wait_state(Alignment.NONE)
        wait_for(lambda: self.tf_at(rospy.Time.now()) is None, "look-ups to fail")
        self.assertEqual(self.decide("revert").code, StatusCode.NOTHING_TO_DECIDE)

    def test_the_alignment_as_messages_that_others_know(self):
        self.start_publisher(policy="auto")
        poses = Newest(self.namespace + "/registration/pose", PoseWithCovarianceStamped)
        transforms = Newest(self.namespace + "/registration/transform", TransformStamped)
        message = self.registered(1, 0.25)
        # The axes of the ultrasound are those of the fixed frame, turned by 90 degrees about z, and the CT's origin is
        # 0.2 m along y. A turn about z, of variance 1e-6, moves it along -x of the ultrasound, which is -y here.
        message.transform.translation.y = 0.2
        message.transform.rotation.w = 1.0
        message.fixed_transform.rotation.z = message.fixed_transform.rotation.w = 0.5 ** 0.5
        message.covariance[35] = 1e-6
        self.results.publish(message)
        transform = transforms.wait(lambda m: True, "the transform")
        self.assertEqual((transform.header.frame_id, transform.child_frame_id), (self.fixed, self.ct))
        self.assertEqual(transform.header.stamp, message.header.stamp)
        self.assertEqual(transform.transform, message.fixed_transform)
        pose = poses.wait(lambda m: True, "the pose")
        self.assertEqual((pose.header.frame_id, pose.header.stamp), (self.fixed, message.header.stamp))
        self.assertEqual(pose.pose.pose.position.x, 0.25)
        expected = [0.0] * 36
        expected[7], expected[11], expected[31], expected[35] = 0.04e-6, -0.2e-6, -0.2e-6, 1e-6
        for found, right in zip(pose.pose.covariance, expected):
            self.assertAlmostEqual(found, right, delta=1e-12)
        late = Newest(self.namespace + "/registration/pose", PoseWithCovarianceStamped)
        self.assertEqual(late.wait(lambda m: True, "the pose, for who listens later").pose, pose.pose)
        # What holds no more is said by nobody, whenever one begins to listen.
        self.assertEqual(self.decide("revert").code, StatusCode.OK)
        late = Newest(self.namespace + "/registration/pose", PoseWithCovarianceStamped)
        time.sleep(1.5)
        self.assertIsNone(late.message)

    def test_lookups_fail_within_the_tolerance_after_death(self):
        process = self.start_publisher(policy="auto")
        self.result(1, 0.25)
        self.wait_tf(0.25)
        process.kill()
        last = rospy.Time.now() + rospy.Duration(TOLERANCE_S)
        self.assertLessEqual(self.buffer.get_latest_common_time(self.fixed, self.ct), last)
        wait_for(lambda: rospy.Time.now() > last, "the tolerance to pass")
        with self.assertRaises(tf2_ros.ExtrapolationException):
            self.buffer.lookup_transform(self.fixed, self.ct, rospy.Time.now())

    def test_restart(self):
        process = self.start_publisher(policy="auto", alignment_file=self.file)
        self.result(1, 0.125)
        self.wait_state(Alignment.ACCEPTED, 1)
        self.result(2, 0.25)
        before = self.wait_state(Alignment.ACCEPTED, 2)
        self.wait_tf(0.25)
        process.kill()

        # The latched result 2 arrives again and is not taken for a new one; no CT is known yet.
        process = self.start_publisher(policy="auto", alignment_file=self.file, restore="same_ct")
        message = self.wait_state(Alignment.NONE)
        self.assertIn("waits for its CT or accept", message.message)
        self.hold_ct(OTHER_CT_CRC32)
        self.alignment.wait(lambda m: "another CT" in m.message, "the other CT to be seen")
        self.diagnosis(lambda s: s.level == s.WARN and "another CT" in s.message, "a warning of the other CT")
        self.assertEqual(self.decide_on_kept("accept").code, StatusCode.INVALID_REQUEST)
        self.assertIsNone(self.tf_at(rospy.Time.now()))
        self.hold_ct(CT_CRC32, "other_frame")
        self.alignment.wait(lambda m: "in frame 'other_frame'" in m.message, "the other frame to be seen")
        self.hold_ct(CT_CRC32)
        message = self.wait_state(Alignment.RESTORED)
        self.wait_tf(0.25)
        self.diagnosis(lambda s: s.level == s.WARN and "before the restart is broadcast" in s.message,
                       "a warning of what is restored")
        self.assertEqual(message.transform, before.transform)
        self.assertEqual(message.header.stamp, before.header.stamp)
        self.assertEqual(message.accepted, before.accepted)
        self.assertEqual((message.result_id, message.ct_crc32), (0, CT_CRC32))

        # A reverted alignment does not come back either.
        self.assertEqual(self.decide("revert").code, StatusCode.OK)
        process.kill()
        self.start_publisher(policy="auto", alignment_file=self.file, restore="same_ct")
        self.assertEqual(self.wait_state(Alignment.NONE).message, "nothing is accepted")
        self.result(3, 0.5)
        self.wait_state(Alignment.ACCEPTED, 3)

    def check_restart_that_waits_for_a_person(self, **parameters):
        process = self.start_publisher(policy="confirm", alignment_file=self.file, **parameters)
        self.hold_ct(CT_CRC32)
        self.result(1, 0.25)
        self.wait_waiting(1)
        self.assertEqual(self.decide("accept").code, StatusCode.OK)
        process.kill()
        # This is the default, also if results are accepted without a person.
        process = self.start_publisher(policy="auto", alignment_file=self.file, **parameters)
        self.alignment.wait(lambda m: m.message.endswith("waits for accept"), "it to wait")
        time.sleep(0.5)  # the CT's latched summary arrives meanwhile
        self.assertEqual(self.alignment.message.state, Alignment.NONE)
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)
        self.assertEqual(self.decide_on_kept("accept").code, StatusCode.OK)
        self.wait_state(Alignment.RESTORED)
        self.wait_tf(0.25)
        process.kill()
        # An old alignment is not offered at all.
        process = self.start_publisher(alignment_file=self.file, restore="same_ct", restore_max_age=0.1, **parameters)
        self.assertEqual(self.wait_state(Alignment.NONE).message, "nothing is accepted")
        self.assertEqual(self.decide("accept").code, StatusCode.NOTHING_TO_DECIDE)
        self.assertIn("must be at most restore_max_age", process.log())

    def test_restart_that_waits_for_a_person(self):
        self.check_restart_that_waits_for_a_person()

    def test_restart_that_waits_for_a_person_as_nodelet(self):
        self.check_restart_that_waits_for_a_person(as_nodelet=True)

    def test_damaged_file(self):
        process = self.start_publisher(policy="auto", alignment_file=self.file)
        self.hold_ct(CT_CRC32)
        self.result(1, 0.25)
        self.wait_state(Alignment.ACCEPTED, 1)
        process.kill()
        with open(self.file) as stream:
            text = stream.read()
        for damaged in ("", text[:len(text) // 2], text.replace("0.25", "0.35")):
            with open(self.file, "w") as stream:
                stream.write(damaged)
            process = self.start_publisher(policy="confirm", alignment_file=self.file)
            self.assertEqual(self.wait_state(Alignment.NONE).message, "nothing is accepted")
            status = self.diagnosis(lambda s: s.level == s.ERROR, "an error")
            self.assertIn(self.file, status.message)
            self.assertIn("damaged", process.log())
            # The latched result arrives again, because the decision on it is no longer known.
            self.wait_waiting(1)
            self.assertEqual(self.decide("accept").code, StatusCode.OK)
            with open(self.file) as stream:
                self.assertIn("0.25", stream.read())
            process.kill()

    def test_what_cannot_be_stored_is_not_accepted(self):
        process = self.start_publisher(policy="auto", alignment_file=self.folder.name + "/missing/alignment.json")
        # It is told at once, and not when a surgeon accepts.
        self.diagnosis(lambda s: s.level == s.ERROR and "missing' does not exist" in s.message, "an error")
        self.assertIn("missing' does not exist", process.log())
        self.result(1, 0.25)
        self.diagnosis(lambda s: s.level == s.ERROR and "missing" in s.message, "an error")
        # It is not lost: a person accepts it once the disk is mended.
        self.assertEqual(self.wait_waiting(1).state, Alignment.NONE)
        self.assertEqual(self.decide("accept").code, StatusCode.FILE_ERROR)
        os.mkdir(self.folder.name + "/missing")
        self.assertEqual(self.decide("accept").code, StatusCode.OK)
        self.wait_tf(0.25)

    def test_without_a_clock_nothing_is_said_to_be_broadcast(self):
        """An earlier launch with a bag leaves /use_sim_time true on the master."""
        rospy.set_param("/use_sim_time", True)
        self.start_publisher(policy="confirm")
        self.result(1, 0.25, header=std_msgs.msg.Header(), us_stamp=rospy.Time())
        self.wait_waiting(1)
        answer = self.decide("accept")
        self.assertIn("nothing is broadcast before simulated time begins", answer.message)
        self.diagnosis(lambda s: s.level == s.ERROR and "/use_sim_time is true" in s.message, "an error")

    def test_another_ct_suspends_it(self):
        self.start_publisher(policy="auto")
        self.hold_ct(CT_CRC32)
        self.result(1, 0.25)
        self.wait_tf(0.25)
        # Without a ct_server, only the registration knows which CT there is.
        for source in (self.info, self.registered_ct):
            source.publish(self.ct_info(OTHER_CT_CRC32))
            self.wait_state(Alignment.NONE)
            wait_for(lambda: self.tf_at(rospy.Time.now()) is None, "look-ups to fail")
            source.publish(self.ct_info(CT_CRC32))
            self.wait_state(Alignment.ACCEPTED, 1)
            self.wait_tf(0.25)

    def test_simulated_time(self):
        self.listener.unregister()  # it would complain about the old times
        rospy.set_param("/use_sim_time", True)
        self.first_stamp_s = 10
        clock = rospy.Publisher("/clock", Clock, queue_size=10)
        process = self.start_publisher(policy="auto")
        transforms = Newest("/tf", tf2_msgs.msg.TFMessage)

        def wait_stamp(now_s):
            """Waits for the stamp now + tolerance, within less than 1 ms."""
            def arrived(message):
                clock.publish(Clock(rospy.Time.from_sec(now_s)))
                stamped = message.transforms[0]
                ahead_s = stamped.header.stamp.to_sec() - now_s - TOLERANCE_S
                return stamped.child_frame_id == self.ct and -1e-6 < ahead_s < 1e-3
            return transforms.wait(arrived, f"a stamp at {now_s}")

        def tick():
            clock.publish(Clock(rospy.Time(100)))
            return self.alignment.message and self.alignment.message.state == Alignment.ACCEPTED
        self.result(1, 0.25)
        wait_for(tick, "the result to be accepted")
        wait_stamp(100.0)
        wait_stamp(200.0)
        # Time stands still; the new alignment gets a later stamp, which distinguishes it from the old one.
        before = transforms.message.transforms[0].header.stamp
        self.result(2, 0.5)
        message = transforms.wait(
            lambda m: m.transforms[0].transform.translation.x == 0.5, "the new transform")
        self.assertGreater(message.transforms[0].header.stamp, before)
        wait_stamp(50.0)
        self.assertIn("time jumped back by 150", process.log())
        wait_stamp(51.0)

    def test_shipped_configuration(self):
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)),
                            "../../config/nodes/tf_publisher.yaml")
        with open(path) as stream:
            self.alignment.message = None
            self.start(**yaml.safe_load(stream))
        self.wait_state(Alignment.NONE)

    def test_wrong_parameters_end_it(self):
        for key, value, constraint in (("polcy", "auto", "is not a parameter"),
                                       ("policy", "always", "must be one of"),
                                       ("rate", 0.0, "must be in"),
                                       ("transform_tolerance", 0.01, "must be >= 1 / rate")):
            process = self.start(**{key: value})
            self.assertEqual(process.exit_status(), 2)
            self.assertIn(constraint, process.log())
            self.assertIn(key, process.log())


if __name__ == "__main__":
    rospy.init_node("test_tf_publisher")
    rostest.rosrun("us_ct_registration", "tf_publisher", TfPublisher)
