#!/usr/bin/env python3
"""video_overlay from outside: images of an endoscope go in, images with the CT's structures and a status come out."""
import math
import os
import sys
import tempfile
import time
import unittest

import numpy
import rospy
import rostest
import roslaunch.config
import roslaunch.xmlloader
import tf2_msgs.msg
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, Image
from us_ct_registration.msg import Alignment, CtInfo, OverlayStatus, RegistrationResult, StatusCode
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import Newest, Process, wait_for

WIDTH, HEIGHT, FOCAL = 320, 240, 250.0
GREY = 90
CT_CRC32 = 1234567
BASELINE_M = 0.005
# The CT's origin lies 0.1 m before the camera, whose frame is the patient's, moved by this.
DEPTH_M = 0.1
CAMERA_X_M = 0.3
FOLDER = os.path.dirname(os.path.abspath(__file__))


def square(number, name, half_m, depth_m=0.0, colour=(1.0, 0.0, 0.0)):
    """A marker of a square that faces the camera, at this depth behind the CT's origin."""
    marker = Marker(ns=f"{number} {name}", id=number, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.color.r, marker.color.g, marker.color.b = colour
    marker.color.a = 1.0
    corners = [Point(x * half_m, y * half_m, depth_m) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    marker.points = [corners[i] for i in (0, 2, 1, 0, 3, 2)]
    return marker


def deleting():
    marker = Marker(action=Marker.DELETEALL)
    marker.pose.orientation.w = 1.0
    return marker


class VideoOverlay(unittest.TestCase):
    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        name = self.namespace[1:]
        # All namespaces share one tf, so that each test has frames of its own.
        self.fixed, self.ct, self.camera = name + "_patient", name + "_ct", name + "_camera"
        self.folder = tempfile.TemporaryDirectory()
        self.processes, self.publishers, self.cameras = [], {}, {}
        self.tf = rospy.Publisher("/tf", tf2_msgs.msg.TFMessage, queue_size=100)
        self.statuses = {}
        self.subscribers = [rospy.Subscriber(self.namespace + "/overlay/status", OverlayStatus, self.take_status)]
        self.images, self.watched = {}, {}
        self.info = self.latched("ct/info", CtInfo)
        self.surface = self.latched("ct/surface", MarkerArray)
        self.alignment = self.latched("registration/alignment", Alignment)
        self.pose = self.latched("registration/pose", PoseWithCovarianceStamped)
        self.result = self.latched("registration/result", RegistrationResult)

    def tearDown(self):
        for process in self.processes:
            process.kill()
        for subscriber in self.subscribers:
            subscriber.unregister()
        self.folder.cleanup()

    def latched(self, topic, kind):
        return rospy.Publisher(f"{self.namespace}/{topic}", kind, queue_size=5, latch=True)

    def take_status(self, status):
        self.statuses[(status.header.frame_id, status.header.stamp)] = status

    def start(self, sides=("",), subscribe=True, **parameters):
        parameters.setdefault("structures", {"tumour": {"band": True, "opacity": 0.5}})
        process = Process("video_overlay", self.namespace, self.folder.name + "/log", **parameters)
        self.processes.append(process)
        for side in sides:
            endoscope = f"{self.namespace}/endoscope/{side}"
            self.cameras[side] = (rospy.Publisher(endoscope + "image_raw", Image, queue_size=100),
                                  rospy.Publisher(endoscope + "camera_info", CameraInfo, queue_size=100))
            if subscribe:
                self.subscribe(side)
        if subscribe:
            for image, info in self.cameras.values():
                wait_for(lambda: image.get_num_connections() and info.get_num_connections(), "the node to subscribe")
        return process

    def subscribe(self, side=""):
        self.images[side] = {}
        subscriber = rospy.Subscriber(f"{self.namespace}/overlay/{side}image", Image,
                                      lambda m: self.images[side].update({m.header.stamp: m}))
        self.subscribers.append(subscriber)
        self.watched[side] = subscriber
        return subscriber

    def align(self, state=Alignment.ACCEPTED, age_s=60.0, **fields):
        """Publishes an alignment, and the CT and the pose that belong to it."""
        self.aligned = Alignment(state=state, ct_frame=self.ct, result_id=7, ct_crc32=CT_CRC32, expected_error=0.001)
        self.aligned.header.frame_id = self.fixed
        self.aligned.header.stamp = rospy.Time.now() - rospy.Duration(age_s)
        if state != Alignment.NONE:
            self.aligned.transform.translation = Vector3(CAMERA_X_M, 0.0, DEPTH_M)
            self.aligned.transform.rotation.w = 1.0
        for name, value in fields.items():
            setattr(self.aligned, name, value)
        self.info.publish(CtInfo(crc32=CT_CRC32))
        self.alignment.publish(self.aligned)

    def show_surfaces(self, *markers):
        markers = markers or (square(1, "kidney", 0.02), square(2, "tumour", 0.01, -0.005, (0.0, 1.0, 0.0)))
        for marker in markers:
            marker.header.frame_id = self.ct
        self.surface.publish(MarkerArray(markers=[deleting(), *markers]))

    def transform(self, child, stamp, x, z):
        message = TransformStamped()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, self.fixed, child
        message.transform.translation = Vector3(x, 0.0, z)
        message.transform.rotation = Quaternion(0.0, 0.0, 0.0, 1.0)
        return message

    def place(self, stamp, camera=True, ct_x=CAMERA_X_M, camera_x=CAMERA_X_M):
        """What tf says at a stamp."""
        transforms = [self.transform(self.ct, stamp, ct_x, DEPTH_M)]
        if camera:
            transforms.append(self.transform(self.camera, stamp, camera_x, 0.0))
        self.tf.publish(tf2_msgs.msg.TFMessage(transforms))

    def image_at(self, stamp, encoding="rgb8", padding=b""):
        """A grey image; `padding` follows each of its rows."""
        row = bytes([GREY]) * (WIDTH * (1 if encoding == "mono8" else 3)) + padding
        image = Image(width=WIDTH, height=HEIGHT, encoding=encoding, step=len(row), data=row * HEIGHT)
        image.header.stamp, image.header.frame_id = stamp, self.camera
        return image

    def info_at(self, stamp, baseline_m=0.0, frame=None, **fields):
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=[-0.2, 0.05, 0.0, 0.0, 0.0])
        info.header.stamp, info.header.frame_id = stamp, frame or self.camera
        info.K = [FOCAL, 0, WIDTH / 2, 0, FOCAL, HEIGHT / 2, 0, 0, 1]
        info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
        info.P = [FOCAL, 0, WIDTH / 2, -FOCAL * baseline_m, 0, FOCAL, HEIGHT / 2, 0, 0, 0, 1, 0]
        for name, value in fields.items():
            setattr(info, name, value)
        return info

    def send(self, stamp, side="", encoding="rgb8", padding=b"", info_stamp=None, baseline_m=0.0, **info):
        image_publisher, info_publisher = self.cameras[side]
        info_publisher.publish(self.info_at(info_stamp or stamp, baseline_m, **info))
        image_publisher.publish(self.image_at(stamp, encoding, padding))

    def drawn(self, condition=lambda status: True, what="a status", stamp_of=rospy.Time.now, placed=True, side="",
              **sending):
        """Sends images until the status of one fulfils the condition: that status and the image."""
        newest = []

        def shown():
            stamp = stamp_of()
            if placed:
                self.place(stamp)
            self.send(stamp, side, **sending)
            time.sleep(0.05)
            for (_, stamp), status in sorted(self.statuses.items(), key=lambda item: item[0][1]):
                newest[:] = [status]
                if condition(status) and stamp in self.images[side]:
                    return status, self.images[side][stamp]
            return None
        try:
            return wait_for(shown, what, 20.0)
        except AssertionError as error:
            raise AssertionError(f"{error}, the newest being:\n{newest}") from None

    def refused(self, words, **arguments):
        self.statuses.clear()
        status, image = self.drawn(lambda s: s.state == OverlayStatus.NOTHING and words in s.message, words,
                                   **arguments)
        self.assertEqual((list(status.in_view), status.result_id), ([], 0))
        self.assertTrue(math.isnan(status.error_bound))
        # There is a text in the image, and nothing else.
        pixels = self.pixels(image)
        self.assertTrue((pixels[80:] == GREY).all())
        self.assertFalse((pixels[:12] == GREY).all())
        return status

    @staticmethod
    def is_drawn(status):
        return status.state != OverlayStatus.NOTHING

    @staticmethod
    def pixels(image):
        rows = numpy.frombuffer(image.data, numpy.uint8).reshape(image.height, image.step)
        return rows[:, :3 * image.width].reshape(image.height, image.width, 3)

    def centre_of_tumour(self, image):
        """Mean column of the pixels in which green prevails."""
        pixels = self.pixels(image).astype(int)[80:200]
        columns = numpy.nonzero(pixels[..., 1] > pixels[..., 0] + 60)[1]
        return columns.mean()

    def check_drawn(self, **parameters):
        self.start(**parameters)
        self.align()
        self.show_surfaces()
        infos = Newest(self.namespace + "/overlay/camera_info", CameraInfo)
        status, image = self.drawn(lambda s: s.state == OverlayStatus.DRAWN and infos.message,
                                   "an overlay and its camera_info")
        self.assertEqual((infos.message.width, infos.message.distortion_model), (WIDTH, "plumb_bob"))
        self.assertEqual(list(status.in_view), ["kidney", "tumour"])
        self.assertEqual((status.header.frame_id, status.camera, status.result_id, status.message), (self.camera, "", 7, ""))
        # Without a covariance: 1.5 times the expected error of 1 mm, 1 mm of hand-eye calibration, and its angle of
        # 0.01 at the distance of the corners of the tumour.
        distance_mm = math.hypot(95.0, 10.0, 10.0)
        self.assertAlmostEqual(1000 * status.error_bound, math.hypot(1.5, 1.0, 0.01 * distance_mm), delta=1e-3)
        self.assertLess(status.latency, 1.0)
        pixels = self.pixels(image)
        self.assertEqual(list(pixels[HEIGHT // 2, 20]), [GREY] * 3)
        self.assertGreater(int(pixels[HEIGHT // 2, WIDTH // 2 - 40, 0]), GREY + 20)  # kidney, red
        self.assertGreater(int(pixels[HEIGHT // 2, WIDTH // 2, 1]), GREY + 20)  # tumour, green

    def test_drawn(self):
        self.check_drawn()

    def test_drawn_as_nodelet(self):
        self.check_drawn(as_nodelet=True)

    def test_encodings(self):
        self.start()
        self.align()
        self.show_surfaces()
        for encoding, output, channel in (("bgr8", "bgr8", 2), ("mono8", "rgb8", 0)):
            self.statuses.clear()
            _, image = self.drawn(self.is_drawn, encoding, encoding=encoding)
            self.assertEqual(image.encoding, output)
            self.assertGreater(int(self.pixels(image)[HEIGHT // 2, WIDTH // 2 - 40, channel]), GREY + 20)
        # An image that is shorter than it says, or of an unknown encoding, comes to nothing.
        for change, words in (({"data": b"short"}, "has 5 bytes"), ({"encoding": "what8"}, "what8"),
                              # Three times this width is 2 in 32 bits.
                              ({"width": 1431655766, "step": 2, "data": bytes(2 * HEIGHT)}, "at least 4294967298")):
            self.assertIn(words, self.message_without_image(self.image_at(rospy.Time.now()), **change))
        self.statuses.clear()
        self.drawn(self.is_drawn, "images after those that cannot be decoded")

    def message_without_image(self, image, **changes):
        """Sends an image with these fields changed, for which none comes out: what the status says of it."""
        for name, value in changes.items():
            setattr(image, name, value)
        stamp = image.header.stamp
        self.place(stamp)
        self.cameras[""][1].publish(self.info_at(stamp))
        self.cameras[""][0].publish(image)
        status = wait_for(lambda: self.statuses.get((self.camera, stamp)), "its status")
        self.assertEqual((status.state, list(status.in_view)), (OverlayStatus.NOTHING, []))
        self.assertNotIn(stamp, self.images[""])
        return status.message

    def test_rows_with_padding(self):
        """Frame grabbers align the rows of their images."""
        self.start()
        self.align()
        self.show_surfaces()
        padding = bytes([1, 255, 7, 200, 33])

        def picture(encoding, **sending):
            begin = rospy.Time.now()
            _, image = self.drawn(lambda s: self.is_drawn(s) and s.header.stamp >= begin, encoding, encoding=encoding,
                                  **sending)
            self.assertEqual(len(image.data), image.step * HEIGHT)
            return self.pixels(image)
        for encoding in ("rgb8", "bgr8", "mono8"):
            # No padding is seen, and all that is drawn is in its place: the pictures are the same, bit by bit.
            numpy.testing.assert_array_equal(picture(encoding, padding=padding), picture(encoding))
            # Without its last byte, an image is not published.
            short = self.image_at(rospy.Time.now(), encoding, padding)
            message = self.message_without_image(short, data=short.data[:-1])
            self.assertRegex(message, rf"has {len(short.data)} bytes|step != size .* != {len(short.data)}")

    def test_stamps_and_tf(self):
        self.start(tf_timeout=0.05)
        self.align()
        self.show_surfaces()
        self.refused("tf does not connect", placed=False)
        self.drawn(self.is_drawn, "tf to be there")
        self.refused("tf does not connect", stamp_of=lambda: rospy.Time.now() - rospy.Duration(100), placed=False)
        self.refused("tf does not connect", stamp_of=lambda: rospy.Time.now() + rospy.Duration(5), placed=False)
        self.refused("ahead of this node's clock", stamp_of=lambda: rospy.Time.now() + rospy.Duration(100),
                     placed=False)
        # tf would take the stamp 0 for the newest transform.
        self.refused("no stamp", stamp_of=lambda: rospy.Time(0), placed=False)

        def elsewhere():
            stamp = rospy.Time.now()
            self.place(stamp, ct_x=CAMERA_X_M + 0.001)
            return stamp
        time.sleep(0.1)
        self.refused("another alignment", stamp_of=elsewhere, placed=False)
        # The arm of the camera is not heard of for a second, in which it moves by 4 cm.
        time.sleep(0.5)
        begin = rospy.Time.now() - rospy.Duration(0.2)
        self.place(begin)
        time.sleep(1.0)
        self.place(begin + rospy.Duration(1.0), camera_x=CAMERA_X_M + 0.04)
        self.refused("no pose is interpolated", stamp_of=lambda: begin + rospy.Duration(0.5), placed=False)
        self.statuses.clear()
        self.drawn(self.is_drawn, "an overlay after all that was refused")

    def test_camera_info(self):
        self.start()
        self.align()
        self.show_surfaces()
        self.drawn(self.is_drawn, "an overlay")
        self.refused("no camera_info with the stamp of the image", info_stamp=rospy.Time(1))
        self.refused("is for images of 640 x 240", width=640)
        self.refused("'distortion_model' is 'equidistant', must be plumb_bob or rational_polynomial",
                     distortion_model="equidistant", D=[0.1, 0.1, 0.1, 0.1])
        self.refused("must have 8 for rational_polynomial", distortion_model="rational_polynomial")
        self.refused("folds back", D=[-3.0, 0.0, 0.0, 0.0, 0.0])
        self.refused("not calibrated", K=[0.0] * 9)
        self.refused("right camera of a pair", baseline_m=BASELINE_M)
        self.statuses.clear()
        self.drawn(self.is_drawn, "a rational distortion", distortion_model="rational_polynomial",
                   D=[0.1, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0])

    def test_a_right_camera_with_its_own_frame(self):
        """It is drawn alone, as the left one would be: tf has it where it is, so that its baseline counts no more."""
        self.start(own_frame=True)
        self.align()
        self.show_surfaces()
        status, image = self.drawn(lambda s: s.state == OverlayStatus.DRAWN, "an overlay", baseline_m=BASELINE_M)
        self.assertEqual((list(status.in_view), status.camera, status.message), (["kidney", "tumour"], "", ""))
        self.assertAlmostEqual(self.centre_of_tumour(image), WIDTH / 2, delta=0.7)

    def test_a_right_camera_with_its_own_frame_rectified(self):
        self.start(own_frame=True, rectified=True)
        self.align()
        self.show_surfaces()
        _, image = self.drawn(lambda s: s.state == OverlayStatus.DRAWN, "an overlay", baseline_m=BASELINE_M)
        self.assertAlmostEqual(self.centre_of_tumour(image), WIDTH / 2, delta=0.7)

    def test_a_frame_with_a_leading_slash(self):
        self.start(tf_timeout=10.0)
        self.align()
        self.show_surfaces()
        # At once, and with words in place of a warning of tf2 every millisecond.
        status = self.refused("must be without leading /", frame="/" + self.camera)
        self.assertLess(status.latency, 5.0)
        self.assertLess(len(self.processes[0].log()), 10000)

    def test_an_image_that_comes_long_after_its_camera_info(self):
        """As one that is rectified or decoded first."""
        self.start()
        self.align()
        self.show_surfaces()
        image_publisher, info_publisher = self.cameras[""]
        waiting, stamps = [], []
        for _ in range(40):
            stamps.append(rospy.Time.now())
            self.place(stamps[-1])
            info_publisher.publish(self.info_at(stamps[-1]))
            waiting.append(self.image_at(stamps[-1]))
            if len(waiting) > 8:
                image_publisher.publish(waiting.pop(0))
            time.sleep(0.03)
        sent = stamps[:32]
        wait_for(lambda: (self.camera, sent[-1]) in self.statuses, "the status of the last image")
        answered = [self.statuses[(self.camera, s)] for s in sent if (self.camera, s) in self.statuses]
        self.assertGreater(len(answered), 16)
        self.assertEqual({s.state for s in answered[-16:]}, {OverlayStatus.DRAWN})

    def test_no_camera_info(self):
        self.start()
        self.align()
        self.show_surfaces()
        self.cameras[""] = (self.cameras[""][0], rospy.Publisher(self.namespace + "/elsewhere", CameraInfo,
                                                                 queue_size=1))
        self.refused(f"no camera_info on {self.namespace}/endoscope/camera_info")

    def test_surfaces(self):
        self.start()
        self.refused("has not said which alignment counts")
        self.align()
        self.refused("no surfaces of the CT")
        empty = square(1, "kidney", 0.02)
        empty.points = []
        self.show_surfaces(empty)
        self.refused("the surfaces of the CT are empty")
        self.show_surfaces()
        self.drawn(self.is_drawn, "an overlay")
        self.info.publish(CtInfo(crc32=1))
        self.refused("of another CT")
        self.info.publish(CtInfo(crc32=CT_CRC32))
        # A structure behind the camera is not drawn, and the image says that nothing is in view.
        self.show_surfaces(square(1, "kidney", 0.02, -0.3))
        self.statuses.clear()
        status, image = self.drawn(lambda s: self.is_drawn(s) and not s.in_view, "nothing in view")
        self.assertTrue((self.pixels(image)[80:200] == GREY).all())
        broken = square(1, "kidney", 0.02)
        broken.points.pop()
        self.show_surfaces(broken)
        wait_for(lambda: "must have three per triangle" in self.processes[0].log(), "the broken surface to be refused")
        self.refused("no surfaces of the CT")

    def test_alignment(self):
        self.start(old_after=600.0)
        self.show_surfaces()
        self.align(Alignment.NONE, message="nothing is accepted")
        self.refused("no alignment: nothing is accepted")

        def warned(words, **fields):
            self.align(**fields)
            self.statuses.clear()
            self.drawn(lambda s: s.state == OverlayStatus.DRAWN_WITH_WARNING and words in s.message, words)
        warned("RESTORED", state=Alignment.RESTORED)
        warned("OLD", age_s=1200.0)
        warned("WAITING", waiting_id=9)
        warned("UNKNOWN ERROR of tumour", expected_error=float("nan"))
        refusal = RegistrationResult()
        refusal.status.code, refusal.status.message = StatusCode.LOW_CONFIDENCE, "the kidney is nearly symmetric"
        self.result.publish(refusal)
        warned("REFUSED: the last registration: the kidney is nearly symmetric")
        refusal.status.code = StatusCode.REGISTERED
        self.result.publish(refusal)
        self.align()
        self.statuses.clear()
        self.drawn(lambda s: s.state == OverlayStatus.DRAWN, "an overlay without warning")
        self.align(Alignment.NONE, message="reverted")
        self.refused("no alignment: reverted")

    def test_error_at_the_tumour(self):
        """The covariance of registration/pose: 1 mm along each axis, and a rotation of 0.02 rad about z."""
        self.start(hand_eye_error=0.0, hand_eye_angle_error=0.0)
        self.show_surfaces()
        self.align()
        pose = PoseWithCovarianceStamped(header=self.aligned.header)
        covariance = numpy.zeros((6, 6))
        covariance[range(3), range(3)] = 0.001 ** 2
        covariance[5, 5] = 0.02 ** 2
        pose.pose.covariance = list(covariance.ravel())
        self.pose.publish(pose)
        # The corners of the tumour are 10 mm sqrt(2) from the axis of the CT.
        expected_mm = 1.5 * math.sqrt(3.0 + (0.02 * 10.0) ** 2 * 2.0)
        self.drawn(lambda s: abs(1000 * s.error_bound - expected_mm) < 1e-3, f"a bound of {expected_mm} mm")

    def test_revoked_while_it_waits_for_tf(self):
        self.start(tf_timeout=5.0)
        self.align()
        self.show_surfaces()
        self.drawn(self.is_drawn, "an overlay")
        stamp = rospy.Time.now() + rospy.Duration(1.0)
        self.send(stamp)
        time.sleep(0.5)  # the image now waits for tf
        self.align(Alignment.NONE, message="reverted")
        time.sleep(0.5)
        self.place(stamp)
        status = wait_for(lambda: self.statuses.get((self.camera, stamp)), "the status of the image")
        self.assertEqual(status.state, OverlayStatus.NOTHING)
        self.assertIn("changed while the image was drawn", status.message)
        # What had been drawn by then is no longer told either.
        self.assertEqual((list(status.in_view), status.result_id), ([], 0))
        self.assertTrue(math.isnan(status.error_bound))
        image = wait_for(lambda: self.images[""].get(stamp), "the image")
        self.assertTrue((self.pixels(image)[80:] == GREY).all())

    def test_stereo(self):
        self.start(sides=("left/", "right/"), stereo=True)
        self.align()
        self.show_surfaces()
        self.refused("no camera_info of the left camera", side="right/", baseline_m=BASELINE_M)
        self.refused("OUT OF STEP: no image of the left camera", side="right/", baseline_m=BASELINE_M)
        left, right = self.pair_of_overlays()
        # Points at the depth of the tumour; the distortion is small near the centre.
        disparity = FOCAL * BASELINE_M / (DEPTH_M - 0.005)
        self.assertAlmostEqual(self.centre_of_tumour(left) - self.centre_of_tumour(right), disparity, delta=0.7)
        # A camera that was calibrated alone, in the frame of the other one.
        self.place(rospy.Time.now())
        self.send(rospy.Time.now(), "left/")
        self.refused("'P' has no baseline", side="right/")

        # Who looks at the right eye alone: the frame of the left camera is known all the same.
        self.watched["left/"].unregister()
        wait_for(lambda: not self.cameras["left/"][0].get_num_connections(), "the left images to be left alone")
        self.assertEqual(self.cameras["left/"][1].get_num_connections(), 1)
        self.statuses.clear()
        self.drawn(lambda s: s.state == OverlayStatus.DRAWN, "the right eye alone", side="right/",
                   baseline_m=BASELINE_M)
        self.subscribe("left/")
        wait_for(lambda: self.cameras["left/"][0].get_num_connections(), "the left images to be subscribed to")

        # From now on the right images are 0.5 s older than the left ones.
        def late():
            stamp = rospy.Time.now()
            self.place(stamp)
            self.send(stamp, "left/")
            time.sleep(0.05)
            return [s for s in self.statuses.values() if "OUT OF STEP" in s.message]
        (status, *_) = wait_for(late, "the pair to be out of step")
        self.assertEqual(status.state, OverlayStatus.DRAWN_WITH_WARNING)

    def pair_of_overlays(self, right="right/"):
        """The newest images of both eyes. `right`: where the images of the right camera are published."""
        left = "left/" if right == "right/" else "right/"

        def pair():
            stamp = rospy.Time.now()
            self.place(stamp)
            self.send(stamp, left)
            self.send(stamp, right, baseline_m=BASELINE_M)
            time.sleep(0.05)
            both = sorted(set(self.images["left/"]) & set(self.images["right/"]))
            done = [s for s in both if s in drawn_in_both]
            return [self.images[side][done[-1]] for side in ("left/", "right/")] if done else None
        # Both eyes have the same frame and stamp, so that the one status would hide the other.
        drawn_in_both, counts = set(), {}

        def count(status):
            if self.is_drawn(status):
                counts[status.header.stamp] = counts.get(status.header.stamp, 0) + 1
                if counts[status.header.stamp] == 2:
                    drawn_in_both.add(status.header.stamp)
        self.subscribers.append(rospy.Subscriber(self.namespace + "/overlay/status", OverlayStatus, count))
        return wait_for(pair, "a pair of overlays")

    def test_swapped_eyes(self):
        """Crossed cables, put right by remaps whose targets are names that the node has as well."""
        endoscope = self.namespace + "/endoscope"
        self.start(sides=("left/", "right/"), stereo=True,
                   remaps={"endoscope/left/image_raw": endoscope + "/right/image_raw",
                           "endoscope/right/image_raw": endoscope + "/left/image_raw"})
        self.align()
        self.show_surfaces()
        left, right = self.pair_of_overlays(right="left/")
        self.assertAlmostEqual(self.centre_of_tumour(left), WIDTH / 2, delta=0.7)
        self.assertLess(self.centre_of_tumour(right), WIDTH / 2 - 10)

    def test_images_are_subscribed_to_only_while_somebody_looks(self):
        self.start(subscribe=False)
        image, info = self.cameras[""]
        time.sleep(2.0)
        self.assertEqual((image.get_num_connections(), info.get_num_connections()), (0, 0))
        for _ in range(2):
            subscriber = self.subscribe()
            wait_for(lambda: image.get_num_connections() and info.get_num_connections(), "the node to subscribe")
            subscriber.unregister()
            wait_for(lambda: not image.get_num_connections() and not info.get_num_connections(),
                     "the node to unsubscribe")

    def test_the_newest_image_wins(self):
        self.start(tf_timeout=0.2)
        self.align()
        self.show_surfaces()
        self.drawn(self.is_drawn, "an overlay")
        self.statuses.clear()
        # Without tf each image takes 0.2 s; they come every 10 ms.
        stamps = []
        for _ in range(100):
            stamps.append(rospy.Time.now() + rospy.Duration(3.0))
            self.send(stamps[-1])
            time.sleep(0.01)
        wait_for(lambda: (self.camera, stamps[-1]) in self.statuses, "the last image", 3.0)
        answered = [stamp for stamp in stamps if (self.camera, stamp) in self.statuses]
        self.assertLess(len(answered), 15)
        self.assertGreater(self.statuses[(self.camera, stamps[-1])].dropped, 50)

    def test_how_a_structure_is_drawn(self):
        """What the parameters say of each structure is in the image."""
        blue, half, yellow = (0, 0, 255), 0.5, lambda pixel: min(pixel[0], pixel[1]) > pixel[2] + 20
        self.start(structures={"kidney": {"colour": [0.0, 0.0, 1.0], "opacity": half, "band": True},
                               "tumour": {"visible": False}})
        self.align()
        cyst = square(3, "cyst", 0.005, colour=(0.0, 1.0, 0.0))
        cyst.pose.position.x = 0.04
        self.show_surfaces(square(1, "kidney", 0.02), square(2, "tumour", 0.01, -0.005, (0.0, 1.0, 0.0)), cyst)
        status, image = self.drawn(lambda s: s.state == OverlayStatus.DRAWN, "an overlay")
        # A structure that is not drawn hides nothing either.
        self.assertEqual(list(status.in_view), ["kidney", "cyst"])
        self.assertFalse(math.isnan(status.error_bound))
        row = self.pixels(image)[HEIGHT // 2].astype(int)
        mixed = numpy.array(blue) * half + GREY * (1 - half)
        for column in (WIDTH // 2 - 40, WIDTH // 2):
            numpy.testing.assert_allclose(row[column], mixed, atol=1.5)
        # The outline of the kidney lies 50 px from the middle, and its band reaches some 6 px further.
        numpy.testing.assert_allclose(row[WIDTH // 2 - 50], blue, atol=1.5)
        self.assertTrue(yellow(row[WIDTH // 2 - 54]), row[WIDTH // 2 - 54])
        # A structure without parameters has the colour of ct/surface, and no band.
        numpy.testing.assert_allclose(row[WIDTH // 2 + 100], [0.75 * GREY, 0.75 * GREY + 0.25 * 255, 0.75 * GREY], atol=1.5)
        self.assertFalse(any(yellow(pixel) for pixel in row[WIDTH // 2 + 75:]))

    def test_diagnostics(self):
        self.start(diagnostic_period=0.1, structures={"tumor": {"band": True}})
        self.align()
        self.show_surfaces()
        own = self.namespace[1:] + "/video_overlay: overlay"
        found = {}
        self.subscribers.append(rospy.Subscriber(
            "/diagnostics", DiagnosticArray, lambda m: found.update({s.name: s for s in m.status})))
        self.drawn(self.is_drawn, "an overlay")
        status = wait_for(lambda: found.get(own) if "'tumor'" in getattr(found.get(own), "message", "") else None,
                          "the misspelt structure to be noticed")
        self.assertIn("it has: 'kidney', 'tumour'", status.message)
        values = wait_for(lambda: {v.key: v.value for v in found[own].values}
                          if any(v.key == "images with overlay" and int(v.value) > 0 for v in found[own].values)
                          else None, "a count of images")
        self.assertGreater(float(values["latency (ms)"]), 0.0)
        self.align(Alignment.NONE, message="reverted")
        self.refused("no alignment: reverted")
        status = wait_for(lambda: found[own] if "nothing is drawn" in found[own].message else None, "the refusal to be told")
        self.assertEqual(status.level, status.ERROR)

    def test_shipped_configuration_and_launch_file(self):
        with open(os.path.join(FOLDER, "../../config/nodes/video_overlay.yaml")) as stream:
            self.check_drawn(**yaml.safe_load(stream))
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.xmlloader.XmlLoader().load(
            os.path.join(FOLDER, "../../launch/overlay.launch"), config, verbose=False,
            argv=["stereo:=true", "left:=/PSM/left", "right:=/PSM/right"])
        (node,) = config.nodes
        self.assertEqual((node.name, dict(node.remap_args)["endoscope/left/image_raw"]),
                         ("video_overlay", "/PSM/left/image_raw"))
        self.assertIs(config.params["/video_overlay/stereo"].value, True)
        for launch_file in ("overlay", "integration"):
            config = roslaunch.config.ROSLaunchConfig()
            roslaunch.xmlloader.XmlLoader().load(
                os.path.join(FOLDER, f"../../launch/{launch_file}.launch"), config, verbose=False,
                argv=["rectified:=true", "right:=/PSM/right"])
            (node,) = [node for node in config.nodes if node.name == "video_overlay"]
            self.assertEqual(dict(node.remap_args)["endoscope/right/image_raw"], "/PSM/right/image_rect_color")

    def test_wrong_parameters_end_it(self):
        for parameters, words in (({"stere": True}, "is not a parameter"),
                                  ({"tf_timeout": -1.0}, "must be in"),
                                  ({"image_transport": "no_such"}, "no plugin is installed"),
                                  # Plugins keep parameters of their own there.
                                  ({"image_transport": "no_such", "no_such": {"mode": 1}}, "no plugin is installed"),
                                  ({"no_such": {"mode": 1}}, "is not a parameter"),
                                  ({"structures": {"tumour": {"bnd": True}}}, "structures/tumour/bnd"),
                                  ({"structures": {"tumour": {"opacity": 2.0}}}, "must be a number in [0, 1]"),
                                  ({"structures": {"tumour": {"colour": [1.0]}}}, "red, green and blue"),
                                  ({"structures": {"tumour": {"visible": 1}}}, "must be true or false"),
                                  ({"structures": {"tumour": True}}, "must be a map")):
            process = Process("video_overlay", self.namespace, self.folder.name + "/log", **parameters)
            self.processes.append(process)
            self.assertEqual(process.exit_status(), 2)
            self.assertIn(words, process.log())


if __name__ == "__main__":
    rospy.init_node("test_video_overlay")
    rostest.rosrun("us_ct_registration", "video_overlay", VideoOverlay)
