#!/usr/bin/env python3
"""The targets of crtk_bridge from outside: points of the CT in a robot's frame, as long as an alignment says where they are."""
import os
import sys
import time

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import Point, PoseStamped, TransformStamped
from std_msgs.msg import Header
from us_ct_registration.msg import StatusCode
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import wait_for
from tf_publisher_case import CT_CRC32, TfPublisherCase

WARN = 1  # of diagnostic_msgs/DiagnosticStatus
SIDE_M = 0.02
TARGETS = ("tumour", "vessel", "entry")


def corner(number, name, at_m):
    """A marker of the tetrahedron with three edges of SIDE_M along the axes that meet at this point."""
    marker = Marker(ns=f"{number} {name}", id=number, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    corners = [Point(*(at_m[j] + SIDE_M * (i == j + 1) for j in range(3))) for i in range(4)]
    marker.points = [corners[i] for i in (0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)]
    return marker


class CrtkTargets(TfPublisherCase):
    first_stamp_s = int(time.time()) - 100

    def setUp(self):
        super().setUp()
        self.robot = self.namespace[1:] + "_robot"
        self.found = {name: [] for name in TARGETS}
        self.subscribers = [rospy.Subscriber(f"{self.namespace}/targets/{name}/measured_cp", PoseStamped,
                                             self.found[name].append) for name in TARGETS]
        self.surface = rospy.Publisher(self.namespace + "/ct/surface", MarkerArray, queue_size=1, latch=True)
        self.hold_ct(CT_CRC32)
        # The robot stands 1 m beside the fixed frame, along y.
        robot = TransformStamped(child_frame_id=self.robot)
        robot.header.frame_id, robot.header.stamp = self.fixed, rospy.Time.now()
        robot.transform.translation.y, robot.transform.rotation.w = 1.0, 1.0
        self.broadcaster = tf2_ros.StaticTransformBroadcaster()
        self.broadcaster.sendTransform(robot)

    def tearDown(self):
        for subscriber in self.subscribers:
            subscriber.unregister()
        super().tearDown()

    def show_surfaces(self, *markers):
        for marker in markers:
            marker.header.frame_id = self.ct
        self.surface.publish(MarkerArray(markers=list(markers)))

    def start_bridge(self, **parameters):
        self.start("crtk_bridge", target_frame=self.robot, diagnostic_period=0.1,
                   targets={"tumour": {"surface": "tumour"}, "vessel": {"surface": "vessel"},
                            "entry": {"point": [0.0, 0.0, 0.1], "ct_crc32": str(CT_CRC32)}}, **parameters)

    def wait_message(self, condition, what):
        """What the diagnostics of the targets say."""
        return self.diagnosis(lambda s: s.name.endswith("crtk_bridge: targets") and condition(s), what).message

    def wait_published(self, name):
        """A pose from now on."""
        now = rospy.Time.now()
        return wait_for(lambda: next((p for p in list(self.found[name]) if p.header.stamp > now), None), name)

    def check_is_at(self, pose, x_m, y_m, z_m):
        self.assertEqual(pose.header.frame_id, self.robot)
        for found, expected in zip((pose.pose.position.x, pose.pose.position.y, pose.pose.position.z), (x_m, y_m, z_m)):
            self.assertAlmostEqual(found, expected, delta=1e-6)

    def accept_one(self):
        self.start_publisher(policy="auto")
        self.result(1, 0.25)
        self.wait_tf(0.25)

    def test_a_name_of_several_structures_is_no_target(self):
        self.start_bridge()
        self.accept_one()
        left, right = corner(2, "vessel", (0.1, 0.0, 0.0)), corner(3, "vessel", (0.2, 0.0, 0.0))
        self.show_surfaces(corner(1, "tumour", (0.0, 0.0, 0.0)), left, right)
        message = self.wait_message(lambda s: s.level == WARN and "targets/" in s.message, "the reason")
        self.assertEqual(message, "not published: targets/vessel: 'surface' is 'vessel', which several structures of "
                                  "ct/surface are called; 'label_table' of ct_server gives each label a name of its own")
        # The others are where they are: a quarter along the edges of the tetrahedron, turned as the result says
        # (0.28 and 0.96 are cosine and sine), and the robot is 1 m away.
        for name, x_m, y_m, z_m in (("tumour", 0.25 + 0.005 * (0.28 - 0.96), 0.005 * (0.96 + 0.28) - 1.0, 0.005),
                                    ("entry", 0.25, -1.0, 0.1)):
            self.check_is_at(self.wait_published(name), x_m, y_m, z_m)
        self.assertEqual(self.found["vessel"], [])
        # The reason does not hide what speaks against the alignment of the others.
        self.result(2, 0.25, header=Header(stamp=rospy.Time.now() - rospy.Duration(7200)))
        self.wait_message(lambda s: "OLD: the ultrasound was acquired 120 min ago" in s.message and "vessel" in s.message,
                          "both warnings")
        self.result(3, 0.25)
        right.ns = "3 vein"
        self.show_surfaces(corner(1, "tumour", (0.0, 0.0, 0.0)), left, right)
        self.check_is_at(self.wait_published("vessel"), 0.25 + 0.28 * 0.105 - 0.96 * 0.005,
                         0.96 * 0.105 + 0.28 * 0.005 - 1.0, 0.005)
        self.assertEqual(self.wait_message(lambda s: "vessel" not in s.message, "the reason to end"), "published")

    def check_revert(self, **parameters):
        self.start_bridge(**parameters)
        self.accept_one()
        self.show_surfaces(corner(1, "tumour", (0.0, 0.0, 0.0)), corner(2, "vessel", (0.1, 0.0, 0.0)))
        for name in TARGETS:
            self.wait_published(name)
        self.assertEqual(self.decide("revert").code, StatusCode.OK)
        message = self.wait_message(lambda s: s.level == WARN, "the reason")
        self.assertEqual(message, "not published: targets: no alignment: nothing is accepted")
        end = rospy.Time.now()
        rospy.sleep(1.0)
        self.assertEqual([p for poses in self.found.values() for p in poses if p.header.stamp > end], [])
        # The next alignment counts at once, and it is another one.
        self.result(2, 0.5)
        self.wait_tf(0.5)
        self.check_is_at(self.wait_published("entry"), 0.5, -1.0, 0.1)

    def test_a_revert_ends_them(self):
        self.check_revert()

    def test_a_revert_ends_them_as_nodelet(self):
        self.check_revert(as_nodelet=True)


if __name__ == "__main__":
    rospy.init_node("test_crtk_targets")
    rostest.rosrun("us_ct_registration", "crtk_targets", CrtkTargets)
