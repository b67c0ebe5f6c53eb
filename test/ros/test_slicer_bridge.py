#!/usr/bin/env python3
"""slicer_bridge from outside: a client that packs and unpacks OpenIGTLink's bytes by itself, as the protocol describes them."""
import os
import re
import socket
import struct
import sys
import threading
import time

import numpy
import rospy
import rostest
import tf2_ros
import yaml
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3
from us_ct_registration.msg import Alignment, CtInfo, StatusCode
from us_ct_registration.srv import (Cancel, CancelResponse, SetInitialAlignment, SetInitialAlignmentRequest,
                                    SetInitialAlignmentResponse)

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import LIMIT_S
from tf_publisher_case import CT_CRC32, OTHER_CT_CRC32, TfPublisherCase

HEADER = struct.Struct(">H12s20sQQQ")
STATUS_OK, STATUS_NOT_READY = 1, 13


def crc64(data):
    """ECMA-182, bit by bit; that of b"123456789" is 0x6C40DF5F0B497347."""
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & 0xFFFFFFFFFFFFFFFF
    return crc


def message(kind, device, content, version=1, **header):
    """`header` replaces fields of the header by wrong ones."""
    if version == 2:
        meta = b"meta data"
        content = struct.pack(">HHII", 12, 2, len(meta), 0) + content + b"\0\0" + meta
    size, crc = header.get("size", len(content)), header.get("crc", crc64(content))
    return HEADER.pack(header.get("number", version), kind.encode(), device.encode(), 0, size, crc) + content


def string(device, text, **header):
    return message("STRING", device, struct.pack(">HH", 3, len(text)) + text.encode(), **header)


def points(device, positions_ras_mm, **header):
    return message("POINT", device, b"".join(
        struct.pack(">64s32s4B3ff20s", b"F", b"Fiducial", 255, 0, 0, 255, *p, 1.0, b"") for p in positions_ras_mm), **header)


class Client:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), LIMIT_S)
        self.unread = b""

    def send(self, data):
        self.socket.sendall(data)

    def close(self):
        self.socket.close()

    def read(self, size):
        while len(self.unread) < size:
            data = self.socket.recv(65536)
            if not data:
                raise EOFError
            self.unread += data
        data, self.unread = self.unread[:size], self.unread[size:]
        return data

    def receive(self, limit_s=LIMIT_S):
        """(type, device, content); None after limit_s."""
        self.socket.settimeout(limit_s)
        try:
            version, kind, device, _, size, crc = HEADER.unpack(self.read(HEADER.size))
            content = self.read(size)
        except socket.timeout:
            return None
        assert version == 1 and crc == crc64(content), (version, crc)
        return kind.rstrip(b"\0").decode(), device.rstrip(b"\0").decode(), content

    def wait(self, kind, device, condition, limit_s=LIMIT_S):
        """The first such message that fulfils the condition, unpacked."""
        end = time.monotonic() + limit_s
        last = None
        while time.monotonic() < end:
            received = self.receive()
            if received and received[:2] == (kind, device):
                last = unpack(kind, received[2])
                if condition(last):
                    return last
        raise AssertionError(f"waited {limit_s:.0f} s for {kind} {device}, the last being {last}")

    def answer_to(self, data, words):
        self.send(data)
        return self.wait("STRING", "answer", lambda text: words in text)

    def is_disconnected(self):
        end = time.monotonic() + LIMIT_S / 4
        try:
            while time.monotonic() < end:
                self.receive(1.0)
        except (EOFError, ConnectionResetError):
            return True
        return False


def unpack(kind, content):
    if kind == "TRANSFORM":
        matrix = numpy.eye(4)
        matrix[:3] = numpy.array(struct.unpack(">12f", content)).reshape(4, 3).T
        return matrix
    if kind == "STATUS":
        return struct.unpack(">H", content[:2])[0], content[30:].rstrip(b"\0").decode()
    length, = struct.unpack(">H", content[2:4])
    assert length == len(content) - 4
    return content[4:].decode()


def pose(translation, axis, angle):
    """4 x 4, by Rodrigues' formula."""
    x, y, z = numpy.array(axis) / numpy.linalg.norm(axis)
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = numpy.eye(4)
    matrix[:3, :3] += numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross
    matrix[:3, 3] = translation
    return matrix


def port_in(diagnosis):
    """0 where it names none."""
    return next((int(pair.value) for pair in diagnosis.values if pair.key == "port"), 0)


class SlicerBridge(TfPublisherCase):
    def setUp(self):
        super().setUp()
        self.us = self.namespace[1:] + "_us"
        self.clients = []
        with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../config/nodes/slicer_bridge.yaml")) as file:
            parameters = yaml.safe_load(file)
        # A port that the test chose could be another program's by the time the node listens there.
        self.start("slicer_bridge", as_nodelet=self.namespace.endswith("as_nodelet"),
                   **{**parameters, "us_frame": self.us, "port": 0})
        # The first diagnosis says only that the node starts.
        self.port = self.port_of("slicer_bridge")
        self.client = self.connect()

    def tearDown(self):
        for client in self.clients:
            client.close()
        super().tearDown()

    def port_of(self, name):
        return port_in(self.diagnosis(lambda s: s.name.endswith(name + ": OpenIGTLink") and port_in(s),
                                      "the server to name its port"))

    def connect(self, port=None):
        self.clients.append(Client(port or self.port))
        return self.clients[-1]

    def command(self, text, words, **header):
        return self.client.answer_to(string("command", text, **header), words)

    def send_tf_of_us(self, T_fixed_us, axis, angle):
        self.broadcaster = tf2_ros.StaticTransformBroadcaster()
        self.broadcaster.sendTransform(self.tf_of_us(T_fixed_us, axis, angle))

    def tf_of_us(self, T_fixed_us, axis, angle):
        """The pose of the ultrasound at the present time."""
        message = TransformStamped(child_frame_id=self.us)
        message.header.frame_id = self.fixed
        message.header.stamp = rospy.Time.now()
        t, q = message.transform.translation, message.transform.rotation
        t.x, t.y, t.z = T_fixed_us[:3, 3] / 1000
        q.x, q.y, q.z = numpy.sin(angle / 2) * numpy.array(axis) / numpy.linalg.norm(axis)
        q.w = numpy.cos(angle / 2)
        return message

    def test_sends_the_transform_while_it_counts_and_decides_by_command(self):
        self.assertEqual(crc64(b"123456789"), 0x6C40DF5F0B497347)
        self.client.wait("STATUS", "registration_status", lambda s: s[0] == STATUS_NOT_READY and "NO TRANSFORM" in s[1])
        axis, angle = (1, -2, 0.5), 0.7
        T_fixed_us = pose((20, -30, 400), axis, angle)
        self.send_tf_of_us(T_fixed_us, axis, angle)
        self.start_publisher(policy="confirm")
        self.result(1, 0.25, transform=Transform(translation=Vector3(x=0.01), rotation=Quaternion(w=1.0)))
        number = str(self.id_of(1))
        self.client.wait("STRING", "registration", lambda text: "WAITING" in text and number in text)

        self.command("accept", "needs the number")
        self.command("accept 0", "needs the number")
        self.command("accept 7", f"result {number} waits")
        self.command(f"accept {number} 7", "needs the number")
        self.command("revert 7", "must be")
        self.command("format c:", "must be")
        self.assertIsNone(self.tf_at(rospy.Time(0)))
        # As of a client of the protocol's version 3.
        self.command(f"accept {number}", f"result {number} is accepted", version=2)

        # The result turns by 2 atan2(0.6, 0.8) about z. RAS has the signs of x and y of LPS changed.
        T_fixed_ct = pose((250, 0, 0), (0, 0, 1), 2 * numpy.arctan2(0.6, 0.8))
        mirror = numpy.diag([-1.0, -1.0, 1.0, 1.0])
        expected = mirror @ numpy.linalg.inv(T_fixed_us) @ T_fixed_ct @ mirror
        found = self.client.wait("TRANSFORM", "ct_to_us", lambda _: True)
        numpy.testing.assert_allclose(found, expected, atol=1e-3)
        # To the ultrasound as it was acquired, which the result tells: 10 mm elsewhere here, as if the probe had moved.
        found = self.client.wait("TRANSFORM", "ct_to_us_acquired", lambda _: True)
        numpy.testing.assert_allclose(found, mirror @ pose((10, 0, 0), (0, 0, 1), 0.0) @ mirror, atol=1e-3)
        self.client.wait("STATUS", "registration_status", lambda s: s[0] == STATUS_OK and "is broadcast" in s[1])

        self.command("revert", "is given up")
        self.client.wait("STATUS", "registration_status",
                         lambda s: s[0] == STATUS_NOT_READY and "nothing is accepted" in s[1])
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            received = self.client.receive(0.5)
            self.assertFalse(received and received[0] == "TRANSFORM", "a transform that was revoked")

        self.result(2, 0.25)
        self.wait_waiting(2)
        self.command(f"reject {self.id_of(2)}", "is rejected")
        self.result(3, 9.0, StatusCode.LOW_CONFIDENCE, status=StatusCode(code=StatusCode.LOW_CONFIDENCE, message="too dark"))
        self.client.wait("STRING", "registration", lambda text: "REFUSED, LOW_CONFIDENCE: too dark" in text)

    def test_sends_nothing_when_tf_has_nothing_new_as_nodelet(self):
        axis, angle = (0, 0, 1), 0.2
        self.send_tf_of_us(pose((0, 0, 100), axis, angle), axis, angle)
        publisher = self.start_publisher(policy="auto", alignment_file=self.file)
        self.result(1, 0.25)
        self.client.wait("TRANSFORM", "ct_to_us", lambda _: True)
        # tf_publisher dies, and its last latched word remains that the alignment is broadcast.
        publisher.kill()
        self.client.wait("STATUS", "registration_status",
                         lambda s: s[0] == STATUS_NOT_READY and "not in force: tf does not connect" in s[1], 20)
        self.client.wait("STRING", "registration", lambda text: "NO POSE" in text)
        # Whoever looks at Slicer alone must learn that the alignment is from before the restart.
        self.hold_ct(CT_CRC32)
        self.start_publisher(policy="auto", alignment_file=self.file, restore="same_ct")
        self.client.wait("STATUS", "registration_status",
                         lambda s: s[0] == STATUS_OK and "RESTORED: the patient may have moved" in s[1])

    def test_sends_nothing_when_the_newest_transform_is_too_old(self):
        """The tracking of the probe stops, while the alignment is in force."""
        axis, angle = (0, 0, 1), 0.2
        tracking = tf2_ros.TransformBroadcaster()
        self.start("slicer_bridge", name="patient_bridge", us_frame=self.us, port=0, max_tf_age=3600.0)
        port_of_patient = self.port_of("patient_bridge")
        self.start_publisher(policy="auto")
        self.result(1, 0.25)
        self.wait_state(Alignment.ACCEPTED, 1)

        def tracked():
            """The tracking works until the client has got a transform."""
            is_ended = threading.Event()

            def track():
                while not is_ended.wait(0.05):
                    tracking.sendTransform(self.tf_of_us(pose((0, 0, 100), axis, angle), axis, angle))
            thread = threading.Thread(target=track, daemon=True)
            thread.start()
            self.client.wait("TRANSFORM", "ct_to_us", lambda _: True)
            self.client.wait("STATUS", "registration_status", lambda s: s[0] == STATUS_OK)
            is_ended.set()
            thread.join()
        tracked()
        reason = re.compile(r"NO TRANSFORM is sent: the newest transform from '\w+_ct' to '\w+_us' is [\d.]+ s old, "
                            r"must be at most max_tf_age = 1\.0 s")
        self.client.wait("STATUS", "registration_status",
                         lambda s: s[0] == STATUS_NOT_READY and reason.fullmatch(s[1]))
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            received = self.client.receive(0.5)
            self.assertFalse(received and received[0] == "TRANSFORM", "a transform that is too old")
        # It is the limit alone: a bridge with a longer one sends this transform.
        self.connect(port_of_patient).wait("TRANSFORM", "ct_to_us", lambda _: True)
        tracked()

    def test_landmarks_become_the_initial_alignment(self):
        requests = []

        def take(request):
            requests.append(request)
            return SetInitialAlignmentResponse(status=StatusCode(code=StatusCode.OK, message="set"), residual=0.0025)
        service = rospy.Service(self.namespace + "/registration/set_initial_alignment", SetInitialAlignment, take)
        ct = [(10.5, -20, 30), (11, 22, -33), (-44, 55, 66)]
        us = [(1, 2, 3), (4, 5, 7), (-7, 8, 9)]
        self.client.answer_to(points("elsewhere", ct), "'elsewhere' are not used")
        self.client.answer_to(points("ct_landmarks", ct), "3 landmarks of the CT and 0 of the ultrasound")
        self.client.answer_to(points("us_landmarks", us[:2]), "3 landmarks of the CT and 2 of the ultrasound")
        self.assertEqual(requests, [])
        self.client.answer_to(points("us_landmarks", us, version=2), "set; the landmarks agree to 2.5 mm")
        request, = requests
        self.assertEqual((request.type, request.header.frame_id), (SetInitialAlignmentRequest.LANDMARKS, self.us))
        for found, sent in ((request.points_ct, ct), (request.points, us)):
            self.assertEqual(found, [Point(-x / 1000, -y / 1000, z / 1000) for x, y, z in sent])
        # Those of another CT, or of the same voxels in another frame, are forgotten.
        for frame, crc32 in (("a_ct", CT_CRC32), ("a_ct", OTHER_CT_CRC32), ("another_ct", OTHER_CT_CRC32)):
            info = CtInfo(crc32=crc32)
            info.header.frame_id = frame
            self.registered_ct.publish(info)
            time.sleep(0.5)
            self.client.answer_to(points("us_landmarks", us), "0 landmarks of the CT and 3 of the ultrasound")
            self.client.answer_to(points("ct_landmarks", ct), "set; the landmarks agree to 2.5 mm")
        service.shutdown()

    def test_a_node_that_hangs_holds_up_nothing(self):
        go_on = threading.Event()

        def hang(_):
            go_on.wait(LIMIT_S)
            return CancelResponse(status=StatusCode(code=StatusCode.OK, message="cancelled at last"))
        service = rospy.Service(self.namespace + "/registration/cancel", Cancel, hang)
        self.client.send(8 * string("command", "cancel"))
        self.command("cancel", "8 calls wait")
        self.client.wait("STATUS", "registration_status", lambda _: True)
        go_on.set()
        self.client.wait("STRING", "answer", lambda text: "cancelled at last" in text)
        service.shutdown()

    def test_bad_clients_are_disconnected_and_no_other_notices(self):
        # These two only hang: one in the middle of a message, and one that reads nothing.
        self.connect().send(string("command", "revert")[:70])
        self.connect()
        bad = {
            "garbage": b"GET / HTTP/1.1\r\n" + 100 * b"x",
            "version": string("command", "revert", number=7),
            "size": string("command", "revert", size=2**62),
            "larger than any": string("command", "revert", size=65537),
            "checksum": string("command", "revert", crc=1),
            "length of text": message("STRING", "command", struct.pack(">HH", 3, 60000) + b"revert"),
            "empty text": message("STRING", "command", b""),
            "size of points": message("POINT", "ct_landmarks", 137 * b"\0"),
            "not finite": points("ct_landmarks", [(0, float("nan"), 0)]),
            "extended header": message("STRING", "command", struct.pack(">HHII", 12, 0, 2**32 - 1, 0) + b"xy", number=2),
            "no extended header": message("STRING", "command", b"short", number=2),
        }
        for name, data in bad.items():
            client = self.connect()
            client.send(data)
            self.assertTrue(client.is_disconnected(), name)
        # What is not for this program is read over, and a message may come in pieces.
        self.client.send(message("IMAGE", "picture", 1000 * b"\0") + message("GET_STATUS", "", b""))
        whole = string("command", "revert")
        self.client.send(whole[:30])
        time.sleep(0.1)
        self.client.answer_to(whole[30:], "nobody offers the service")
        # There is an end to the number of clients.
        for _ in range(8):
            self.connect()
        self.assertTrue(self.connect().is_disconnected())
        self.client.answer_to(whole, "nobody offers the service")


if __name__ == "__main__":
    rospy.init_node("test_slicer_bridge")
    rostest.rosrun("us_ct_registration", "slicer_bridge", SlicerBridge)
