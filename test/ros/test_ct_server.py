#!/usr/bin/env python3
"""ct_server from outside: the files that it reads and refuses, its messages and its answers."""
import gzip
import io
import os
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
import zlib

import numpy
import roslaunch.config
import roslaunch.xmlloader
import roslib.packages
import rospy
import rostest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import PointCloud2
from us_ct_registration.msg import CtInfo, CtVolume, StatusCode
from us_ct_registration.srv import GetCt, LoadCt, SetCtRoi
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from node_under_test import PACKAGE, Newest, Process, call, wait_for

# Voxels i, j, k; each has its own step, and the axes are turned about z by the angle of (4, 3) / 5.
SIZE = (24, 20, 16)
SPACING_MM = numpy.array((1.5, 2.0, 2.5))
ORIGIN_MM = numpy.array((-30.0, 12.5, 400.0))
DIRECTION = numpy.array(((0.8, -0.6, 0.0), (0.6, 0.8, 0.0), (0.0, 0.0, 1.0)))
CENTRE_MM = ORIGIN_MM + DIRECTION @ (SPACING_MM * (numpy.array(SIZE) - 1) / 2)
BALL_MM = 10.0
LABEL = 3
PATIENT = ("ROE^RICHARDA", "PAT-77031", "Quux")


def places_mm():
    """Positions of the voxels, indexed [k, j, i]."""
    k, j, i = numpy.meshgrid(*(numpy.arange(n) for n in SIZE[::-1]), indexing="ij")
    return numpy.stack((i, j, k), -1) * SPACING_MM @ DIRECTION.T + ORIGIN_MM


DISTANCE_MM = numpy.linalg.norm(places_mm() - CENTRE_MM, axis=-1)
HOUNSFIELD = numpy.where(DISTANCE_MM < BALL_MM, 300 - 10 * DISTANCE_MM, -50).astype("<i2")
HOUNSFIELD += numpy.arange(SIZE[0], dtype="<i2")  # no symmetry
LABELS = numpy.where(DISTANCE_MM < BALL_MM, LABEL, 0).astype("<u2")


def write_nrrd(path, voxels, origin_mm=ORIGIN_MM):
    kind = {"i": "int16", "u": "uint16"}[voxels.dtype.kind]
    steps = ["(" + ",".join(repr(float(x)) for x in DIRECTION[:, a] * SPACING_MM[a]) + ")" for a in range(3)]
    header = ["NRRD0004", f"type: {kind}", "dimension: 3",
              "space: left-posterior-superior",
              "sizes: " + " ".join(str(n) for n in voxels.shape[::-1]),
              "space directions: " + " ".join(steps), "endian: little", "encoding: raw",
              "space origin: (" + ",".join(repr(float(x)) for x in origin_mm) + ")"]
    with open(path, "wb") as stream:
        stream.write(("\n".join(header) + "\n\n").encode())
        stream.write(voxels.tobytes())


def write_dicom(folder):
    """A series of files whose names, attributes and free texts name the patient."""
    os.makedirs(folder)
    row, column = DIRECTION[:, 0], DIRECTION[:, 1]
    for k in range(SIZE[2]):
        place = ORIGIN_MM + DIRECTION[:, 2] * SPACING_MM[2] * k
        name = os.path.join(folder, f"{PATIENT[0]}_{k}")
        with open(name + ".raw", "wb") as stream:
            stream.write(HOUNSFIELD[k].tobytes())
        attributes = [
            ("0008,0008", "CS", r"ORIGINAL\PRIMARY\AXIAL"), ("0008,0016", "UI", "1.2.840.10008.5.1.4.1.1.2"),
            ("0008,0018", "UI", f"1.2.826.0.1.3680043.2.5.{k + 1}"), ("0008,0060", "CS", "CT"),
            ("0008,0090", "PN", "Quux^Doctor"), ("0010,0010", "PN", PATIENT[0]),
            ("0010,0020", "LO", PATIENT[1]), ("0010,4000", "LT", "seen by Dr Quux"),
            ("0020,000d", "UI", "1.2.826.0.1.3680043.2.6"), ("0020,000e", "UI", "1.2.826.0.1.3680043.2.7"),
            ("0020,0011", "IS", "1"), ("0020,0013", "IS", str(k + 1)),
            ("0020,0032", "DS", "\\".join(f"{x:.10g}" for x in place)),
            ("0020,0037", "DS", "\\".join(f"{x:.10g}" for x in (*row, *column))),
            ("0020,0052", "UI", "1.2.826.0.1.3680043.2.8"),
            ("0028,0030", "DS", rf"{SPACING_MM[1]}\{SPACING_MM[0]}"),
            ("0028,0004", "CS", "MONOCHROME2"), ("0028,1052", "DS", "0"), ("0028,1053", "DS", "1")]
        lines = [f"({tag}) {kind} [{value}]" for tag, kind, value in attributes]
        for tag, value in (("0028,0002", 1), ("0028,0010", SIZE[1]), ("0028,0011", SIZE[0]),
                           ("0028,0100", 16), ("0028,0101", 16), ("0028,0102", 15), ("0028,0103", 1)):
            lines.append(f"({tag}) US {value}")
        lines.append(f"(7fe0,0010) OW ={name}.raw")
        lines = ["(0002,0010) UI =LittleEndianExplicit"] + sorted(lines)
        with open(name + ".txt", "w") as stream:
            stream.write("\n".join(lines) + "\n")
        subprocess.run(["dump2dcm", "-q", name + ".txt", name + ".dcm"], check=True)
        os.remove(name + ".txt")
        os.remove(name + ".raw")


class CtServer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = os.path.join(cls.folder.name, "root")
        cls.outside = os.path.join(cls.folder.name, "outside")
        for folder in (cls.root, cls.outside):
            os.mkdir(folder)
            write_nrrd(folder + "/ct.nrrd", HOUNSFIELD)
        write_nrrd(cls.root + "/labels.nrrd", LABELS)
        write_nrrd(cls.root + "/other.nrrd", HOUNSFIELD + numpy.int16(7))
        usct = roslib.packages.find_node(PACKAGE, "usct")[0]
        for extension in ("mha", "mhd", "nii", "nii.gz"):
            subprocess.run([usct, "convert", "--quiet", cls.root + "/ct.nrrd", f"{cls.root}/ct.{extension}"],
                           check=True, stdout=subprocess.DEVNULL)
        write_dicom(cls.root + "/dicom")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        self.processes = []
        self.volume = Newest(self.namespace + "/ct/volume", CtVolume)
        self.info = Newest(self.namespace + "/ct/info", CtInfo)

    def tearDown(self):
        for process in self.processes:
            process.kill()

    def start(self, **parameters):
        log = f"{self.folder.name}/{self.namespace[1:]}.log"
        process = Process("ct_server", self.namespace, log, **parameters)
        self.processes.append(process)
        return process

    def start_again(self):
        """As roslaunch does: with the parameters that there are."""
        parameters = rospy.get_param(self.namespace + "/ct_server")
        return self.start(**parameters)

    def label_table(self):
        path = self.folder.name + "/labels.yaml"
        with open(path, "w") as stream:
            stream.write(f"{LABEL}: {{name: left kidney, colour: [0.5, 0.25, 1.0]}}\n")
        return path

    def load(self, path, labels=""):
        return call(self.namespace + "/ct/load", LoadCt, path, labels)

    def get(self):
        return call(self.namespace + "/ct/get_volume", GetCt)

    def expect_refused(self, code, path, labels="", held=0):
        """Expects a refusal that leaves the held CT; returns the answer's message."""
        answer = self.load(path, labels)
        self.assertEqual((answer.status.code, answer.revision), (code, held), answer.status.message)
        self.assertEqual(self.get().status.code, StatusCode.OK if held else StatusCode.NO_CT)
        self.assertNotIn(self.folder.name, answer.status.message.replace(path, ""))
        return answer.status.message

    def expect_ct(self, message, voxels=HOUNSFIELD):
        self.assertEqual(tuple(message.size), SIZE)
        numpy.testing.assert_allclose(message.spacing, SPACING_MM / 1000, rtol=1e-6)
        numpy.testing.assert_allclose((message.origin.x, message.origin.y, message.origin.z), ORIGIN_MM / 1000,
                                      atol=1e-7)
        numpy.testing.assert_allclose(message.direction, DIRECTION.ravel(), atol=1e-6)
        numpy.testing.assert_array_equal(message.data, voxels.ravel())
        geometry = struct.pack("<3I15d", *message.size, *message.spacing, message.origin.x, message.origin.y,
                               message.origin.z, *message.direction)
        self.assertEqual(message.crc32, zlib.crc32(geometry, zlib.crc32(voxels.tobytes())))

    def check_load(self, **parameters):
        self.start(data_root=self.root, ct_frame="patient_ct", label_table=self.label_table(), **parameters)
        self.assertEqual(self.get().status.code, StatusCode.NO_CT)
        answer = self.load("ct.nrrd", "labels.nrrd")
        self.assertEqual(answer.status.code, StatusCode.OK, answer.status.message)
        volume = self.volume.wait(lambda m: m.revision == answer.revision, "the CT")
        self.expect_ct(volume)
        self.assertEqual(volume.header.frame_id, "patient_ct")
        self.assertGreater(volume.header.stamp, rospy.Time(0))
        # Late subscribers get the same, on each topic.
        late = Newest(self.namespace + "/ct/volume", CtVolume).wait(lambda m: True, "the latched CT")
        self.assertEqual(late.revision, answer.revision)
        self.expect_ct(self.get().volume)
        info = self.info.wait(lambda m: m.revision == answer.revision, "the summary")
        self.assertEqual((info.format, info.crc32, info.labels), ("NRRD", volume.crc32, [f"{LABEL} left kidney"]))
        self.assertEqual((info.lowest, info.highest), (HOUNSFIELD.min(), HOUNSFIELD.max()))
        markers = Newest(self.namespace + "/ct/surface", MarkerArray).wait(lambda m: True, "the surface")
        self.check_ball(markers)
        self.check_mesh(self.check_points())

    def check_ball(self, array):
        """The label's surface lies within a voxel's half diagonal of the ball that was labelled."""
        self.assertEqual([m.action for m in array.markers], [Marker.DELETEALL, Marker.ADD])
        marker = array.markers[1]
        self.assertEqual((marker.type, marker.id, marker.ns), (Marker.TRIANGLE_LIST, LABEL, f"{LABEL} left kidney"))
        self.assertEqual((marker.color.r, marker.color.g, marker.color.b), (0.5, 0.25, 1.0))
        self.assertEqual((marker.header.frame_id, marker.header.stamp), ("patient_ct", rospy.Time(0)))
        points_mm = 1000 * numpy.array([(p.x, p.y, p.z) for p in marker.points])
        radius_mm = numpy.linalg.norm(points_mm - CENTRE_MM, axis=1)
        self.assertLess(numpy.abs(radius_mm - BALL_MM).max(), numpy.linalg.norm(SPACING_MM) / 2)
        a, b, c = (points_mm - CENTRE_MM).reshape(-1, 3, 3).transpose(1, 0, 2)
        enclosed_mm3 = numpy.einsum("ij,ij->", a, numpy.cross(b, c)) / 6
        labelled_mm3 = numpy.count_nonzero(LABELS) * SPACING_MM.prod()
        self.assertLess(abs(enclosed_mm3 / labelled_mm3 - 1), 0.05)

    def check_points(self):
        cloud = Newest(self.namespace + "/ct/surface_points", PointCloud2).wait(lambda m: True, "the points")
        self.assertEqual([f.name for f in cloud.fields], ["x", "y", "z", "label"])
        kind = numpy.dtype({"names": ["x", "y", "z", "label"], "formats": ["<f4"] * 3 + ["<u4"],
                            "offsets": [f.offset for f in cloud.fields], "itemsize": cloud.point_step})
        points = numpy.frombuffer(cloud.data, kind)
        self.assertGreater(len(points), 100)
        self.assertEqual(set(points["label"]), {LABEL})
        place_mm = 1000 * numpy.stack([points[a] for a in "xyz"], 1)
        radius_mm = numpy.linalg.norm(place_mm - CENTRE_MM, axis=1)
        self.assertLess(numpy.abs(radius_mm - BALL_MM).max(), numpy.linalg.norm(SPACING_MM) / 2)
        return cloud

    def check_mesh(self, cloud):
        """The cloud is in the mesh, before 16 bytes per triangle: three corners and their number."""
        mesh = Newest(self.namespace + "/ct/mesh", rospy.AnyMsg).wait(lambda m: True, "the mesh")
        self.assertEqual(mesh._connection_header["type"], "pcl_msgs/PolygonMesh")
        points = io.BytesIO()
        cloud.serialize(points)
        # The number of a message in its own sequence comes first.
        rest = mesh._buff.split(points.getvalue()[4:])[1]
        corners = numpy.frombuffer(rest[4:], "<u4").reshape(-1, 4)
        self.assertEqual(len(corners), numpy.frombuffer(rest[:4], "<u4")[0])
        self.assertEqual(set(corners[:, 0]), {3})
        self.assertEqual(set(corners[:, 1:].ravel()), set(range(cloud.width)))

    def test_load(self):
        self.check_load()

    def test_load_as_nodelet(self):
        self.check_load(as_nodelet=True)

    def test_each_format(self):
        self.start(data_root=self.root)
        revision = 0
        for path, kind in (("ct.nrrd", "NRRD"), ("ct.mha", "MetaImage"), ("ct.mhd", "MetaImage"),
                           ("ct.nii", "NIfTI"), ("ct.nii.gz", "NIfTI"), ("dicom", "DICOM"),
                           (self.root + "/ct.nrrd", "NRRD")):
            answer = self.load(path)
            self.assertEqual(answer.status.code, StatusCode.OK, answer.status.message)
            self.assertGreater(answer.revision, revision)
            revision = answer.revision
            self.expect_ct(self.volume.wait(lambda m: m.revision == revision, path))
            self.assertEqual(self.info.wait(lambda m: m.revision == revision, path).format, kind)

    def test_surface_without_labels(self):
        self.start(data_root=self.root, surface_hu=150.0)
        self.assertEqual(self.load("ct.nrrd").status.code, StatusCode.OK)
        markers = Newest(self.namespace + "/ct/surface", MarkerArray).wait(lambda m: True, "the surface").markers
        self.assertEqual(len(markers), 2)
        self.assertGreater(len(markers[1].points), 100)
        self.assertEqual(self.info.wait(lambda m: True, "what the CT is").labels, [])

    def test_parameters(self):
        process = self.start(path=self.root + "/ct.nrrd", labels=self.root + "/labels.nrrd")
        first = self.volume.wait(lambda m: True, "the CT of the parameters")
        answer = self.load("ct.nrrd")
        self.assertEqual(answer.status.code, StatusCode.PATH_REFUSED)
        self.assertIn("data_root is not set", answer.status.message)
        process.kill()  # usually within the second of the load
        self.volume.message = None
        self.start(path="ct.nrrd", data_root=self.root)
        self.assertGreater(self.volume.wait(lambda m: True, "the CT").revision, first.revision)

    def test_a_path_parameter_that_cannot_be_read(self):
        process = self.start(path="../outside/ct.nrrd", data_root=self.root)
        wait_for(lambda: "must lie below the data root" in process.log(), "the refusal")
        diagnosis = Newest("/diagnostics", DiagnosticArray)
        diagnosis.wait(lambda m: any(s.name.startswith(self.namespace[1:]) and s.level == s.ERROR
                                     and "data root" in s.message for s in m.status), "an error")
        self.assertEqual(self.load("ct.nrrd").status.code, StatusCode.OK)

    def test_what_is_outside_is_refused(self):
        os.symlink(self.outside + "/ct.nrrd", self.root + "/link.nrrd")
        os.symlink(self.outside, self.root + "/link")
        self.start(data_root=self.root)
        for path in (self.outside + "/ct.nrrd", "../outside/ct.nrrd", "dicom/../../outside/ct.nrrd", "/etc/passwd",
                     "/missing", "link.nrrd", "link/ct.nrrd", "link", ""):
            code = StatusCode.PATH_REFUSED if path else StatusCode.FILE_ERROR
            message = self.expect_refused(code, path)
            self.assertIn("data root" if path else "is empty", message)
        self.assertIn("'labels'", self.expect_refused(StatusCode.PATH_REFUSED, "ct.nrrd", "link.nrrd"))
        self.assertIsNone(self.volume.message)

    def test_headers_that_name_data_outside_are_refused(self):
        with open(self.root + "/ct.nrrd", "rb") as stream:
            nrrd, voxels = stream.read().split(b"\n\n", 1)
        with open(self.root + "/ct.mhd", "rb") as stream:
            meta = stream.read().rsplit(b"ElementDataFile", 1)[0]
        with open(self.outside + "/voxels.raw", "wb") as stream:
            stream.write(voxels)
        self.start(data_root=self.root)
        for place in (self.outside + "/voxels.raw", "../outside/voxels.raw"):
            for name, header in (("evil.nhdr", nrrd + f"\ndata file: {place}\n\n".encode()),
                                 ("evil.nrrd", nrrd + f"\ndata file: {place}\n\n".encode()),
                                 ("evil.mhd", meta + f"ElementDataFile = {place}\n".encode()),
                                 ("evil.mha", meta + f"ElementDataFile = {place}\n".encode())):
                with open(f"{self.root}/{name}", "wb") as stream:
                    stream.write(header)
                self.assertIn("same folder", self.load(name).status.message)
        self.assertEqual(self.get().status.code, StatusCode.NO_CT)

    def test_a_size_that_is_too_large_is_refused_before_it_is_read(self):
        size = (1200, 1200, 700)  # 2 GB of zeros in 2 MB
        header = ["NRRD0004", "type: int16", "dimension: 3", "space: left-posterior-superior",
                  "sizes: " + " ".join(map(str, size)), "space directions: (1,0,0) (0,1,0) (0,0,1)",
                  "endian: little", "encoding: gzip", "space origin: (0,0,0)"]
        with open(self.root + "/bomb.nrrd", "wb") as stream:
            stream.write(("\n".join(header) + "\n\n").encode())
            stream.write(gzip.compress(bytes(2 << 20)) + bytes(2 << 20))
        self.start(data_root=self.root)
        message = self.expect_refused(StatusCode.FILE_ERROR, "bomb.nrrd")
        self.assertIn("1200 x 1200 x 700 voxels to keep take 2016 MB, must be at most 950 MB", message)
        # A part of it is small enough; what is compressed then turns out to be less than the header says.
        call(self.namespace + "/ct/roi", SetCtRoi, [Point(0, 0, 0), Point(1, 1, 0.1)], 1)
        self.assertIn("compressed data give 2097152 bytes", self.load("bomb.nrrd").status.message)

    def roi(self, corners, decimation):
        return call(self.namespace + "/ct/roi", SetCtRoi, corners, decimation).status

    def test_part_of_a_ct(self):
        self.start(data_root=self.root)
        first, last = (4, 3, 2), (14, 12, 9)

        def corner(i, j, k):
            return Point(*((ORIGIN_MM + DIRECTION @ (SPACING_MM * (i, j, k))) / 1000))
        # The box is along the axes of the patient, and the voxels are turned by 37 degrees: it covers more of them.
        self.assertEqual(self.roi([corner(*first), corner(*last)], 1).code, StatusCode.OK)
        answer = self.load("ct.nrrd", "labels.nrrd")
        self.assertEqual(answer.status.code, StatusCode.OK, answer.status.message)
        self.assertIn("of 24 x 20 x 16 (ct/roi)", answer.status.message)
        part = self.get().volume
        origin = numpy.array((part.origin.x, part.origin.y, part.origin.z))
        begin = numpy.rint(DIRECTION.T @ (1000 * origin - ORIGIN_MM) / SPACING_MM).astype(int)
        self.assertLessEqual(begin[2], first[2])
        i, j, k = begin
        x, y, z = part.size
        self.assertLess(x * y * z, HOUNSFIELD.size)
        numpy.testing.assert_array_equal(numpy.reshape(part.data, (z, y, x)),
                                         HOUNSFIELD[k:k + z, j:j + y, i:i + x])
        for corners, decimation in (([Point()], 1), ([Point(), Point()], 1), ([], 17),
                                    ([Point(float("nan"), 0, 0), Point(1, 1, 1)], 1)):
            self.assertEqual(self.roi(corners, decimation).code, StatusCode.INVALID_REQUEST)
        self.assertEqual(self.roi([], 2).code, StatusCode.OK)
        self.assertEqual(self.load("ct.nrrd").status.code, StatusCode.OK)
        coarse = self.get().volume
        self.assertEqual(tuple(coarse.size), (12, 10, 8))
        numpy.testing.assert_allclose(coarse.spacing, 2 * SPACING_MM / 1000, rtol=1e-6)
        # Far from the ball the values rise linearly along i: the blocks' centres are at 0.5, 2.5...
        self.assertAlmostEqual(coarse.data[5], HOUNSFIELD[0, 0, 10:12].mean(), delta=0.6)
        self.assertEqual(self.roi([Point(5, 5, 5), Point(6, 6, 6)], 0).code, StatusCode.OK)
        self.assertIn("the region has", self.load("ct.nrrd").status.message)
        self.assertEqual(self.roi([], 0).code, StatusCode.OK)
        self.assertEqual(self.load("ct.nrrd").status.code, StatusCode.OK)
        self.expect_ct(self.get().volume)

    def test_started_again_it_holds_what_it_held(self):
        """roslaunch starts a node that has ended again with the parameters of the master."""
        first = self.start(path="other.nrrd", data_root=self.root)
        self.volume.wait(lambda m: True, "the CT of the launch")
        corners = [Point(*(x / 1000 for x in ORIGIN_MM + DIRECTION @ (SPACING_MM * at))) for at in ((4, 3, 2), (14, 12, 9))]
        self.assertEqual(self.roi(corners, 1).code, StatusCode.OK)
        self.assertEqual(self.load("ct.nrrd", "labels.nrrd").status.code, StatusCode.OK)
        part = self.info.wait(lambda m: m.labels, "the part")
        # What cannot be loaded, and a region of which nothing was loaded, are not held.
        self.assertEqual(self.load("none.nrrd").status.code, StatusCode.FILE_ERROR)
        self.assertEqual(self.roi([], 2).code, StatusCode.OK)
        first.kill()
        self.info.message = None
        again = self.start_again()
        self.assertEqual(self.info.wait(lambda m: True, "the part again").crc32, part.crc32)
        self.assertEqual(self.info.message.labels, part.labels)
        self.assertEqual(self.roi([], 1).code, StatusCode.OK)
        self.assertEqual(self.load("ct.nrrd").status.code, StatusCode.OK)
        again.kill()
        self.volume.message = None
        self.start_again()
        self.expect_ct(self.volume.wait(lambda m: True, "the whole CT"))

    def test_a_misspelt_node_in_override_ends_it(self):
        rospy.set_param(self.namespace + "/override", {"registration": {"seed": 1}, "ct_sever": {"surface_hu": 100}})
        process = self.start()
        self.assertEqual(process.exit_status(), 2)
        self.assertIn("'ct_sever'", process.log())
        rospy.set_param(self.namespace + "/override", {"registration": {"seed": 1}})
        self.start()
        self.assertEqual(self.get().status.code, StatusCode.NO_CT)

    def test_what_is_held_stays_until_the_new_one_is_read(self):
        with open(self.root + "/ct.nrrd", "rb") as stream:
            whole = stream.read()
        with open(self.root + "/half.nrrd", "wb") as stream:
            stream.write(whole[:len(whole) // 2])
        with open(self.root + "/text.nrrd", "wb") as stream:
            stream.write(b"NRRD0004\nThis is no header.\n")
        with open(self.root + "/half_header.mhd", "wb") as stream:
            stream.write(b"ObjectType = Image\nNDims = 3\n")
        write_dicom(self.root + "/half_dicom")
        with open(f"{self.root}/half_dicom/{PATIENT[0]}_5.dcm", "r+b") as stream:
            stream.truncate(700)
        write_nrrd(self.root + "/moved_labels.nrrd", LABELS, ORIGIN_MM + 0.5)
        write_nrrd(self.root + "/part_of_labels.nrrd", LABELS[2:, :, :],
                   ORIGIN_MM + DIRECTION[:, 2] * SPACING_MM[2] * 2)
        self.start(data_root=self.root)
        held = self.load("ct.nrrd").revision
        for path in ("half.nrrd", "text.nrrd", "half_header.mhd", "half_dicom", "missing.nrrd", "labels"):
            message = self.expect_refused(StatusCode.FILE_ERROR, path, held=held)
            self.assertTrue(message.startswith(path + ": "), message)
        for labels in ("missing.nrrd", "half.nrrd", "moved_labels.nrrd"):
            message = self.expect_refused(StatusCode.FILE_ERROR, "other.nrrd", labels, held=held)
            self.assertTrue(message.startswith(labels + ": "), message)
        self.expect_ct(self.get().volume)
        self.assertEqual(self.volume.wait(lambda m: True, "the CT").revision, held)
        answer = self.load("other.nrrd", "part_of_labels.nrrd")
        self.assertEqual(answer.status.code, StatusCode.OK, answer.status.message)
        self.assertGreater(answer.revision, held)
        self.expect_ct(self.get().volume, HOUNSFIELD + numpy.int16(7))

    def test_memory_does_not_grow_from_ct_to_ct(self):
        # 15 MiB each; any of the node's threads may load it.
        large = numpy.zeros((110, 220, 320), "<i2")
        large[30:80, 50:150, 100:200] = 300
        write_nrrd(self.root + "/large.nrrd", large)
        process = self.start(data_root=self.root)
        sizes_mib = []
        for _ in range(12):
            answer = self.load("large.nrrd")
            self.assertEqual(answer.status.code, StatusCode.OK, answer.status.message)
            self.volume.wait(lambda m: m.revision == answer.revision, "the CT")
            sizes_mib.append(process.own_mib())
        self.assertLess(max(sizes_mib) - sizes_mib[1], large.nbytes / 2**20, sizes_mib)

    def test_no_patient_is_named(self):
        heard = {}

        def listen(topic, kind):
            def take(message):
                buffer = io.BytesIO()
                message.serialize(buffer)
                heard.setdefault(topic, []).append(buffer.getvalue())
            return rospy.Subscriber(topic, kind, take)
        mine = [(self.namespace + "/ct/" + name, kind)
                for name, kind in (("volume", CtVolume), ("info", CtInfo), ("surface", MarkerArray),
                                   ("surface_points", PointCloud2), ("mesh", rospy.AnyMsg))]
        topics = [listen(topic, kind)
                  for topic, kind in mine + [("/rosout", Log), ("/diagnostics", DiagnosticArray)]]
        with open(f"{self.root}/dicom/{PATIENT[0]}_3.dcm", "rb") as stream:
            content = stream.read()
        for name in ("ROE", "RICHARDA", "77031", "Quux"):
            self.assertIn(name.encode(), content, "there is something to find")
        process = self.start(data_root=self.root)
        damaged = self.root + "/damaged"
        write_dicom(damaged)
        with open(f"{damaged}/{PATIENT[0]}_3.dcm", "r+b") as stream:
            stream.truncate(900)
        missing = self.root + "/missing_slice"
        write_dicom(missing)
        os.remove(f"{missing}/{PATIENT[0]}_4.dcm")
        with open(f"{missing}/{PATIENT[1]}.txt", "w") as stream:
            stream.write("a note, which is passed over with a warning")
        answers = [self.load(path) for path in ("dicom", "damaged", "missing_slice")]
        self.assertEqual([a.status.code for a in answers],
                         [StatusCode.OK, StatusCode.FILE_ERROR, StatusCode.FILE_ERROR])
        self.assertIn("file ", answers[1].status.message)
        for topic, _ in mine:
            wait_for(lambda t=topic: t in heard, topic)
        for topic in ("/rosout", "/diagnostics"):
            wait_for(lambda t=topic: any(answers[2].status.message.encode() in m for m in heard.get(t, [])),
                     f"the last error on {topic}")
        answers += [self.get()]
        everything = b"\n".join(sum(heard.values(), [])) + process.log().encode() + "".join(str(a) for a in answers).encode()
        for name in ("ROE", "RICHARDA", "77031", "Quux"):
            self.assertNotIn(name.encode(), everything)
        for topic in topics:
            topic.unregister()

    def test_it_answers_while_it_loads(self):
        self.start(data_root=self.root, diagnostic_period=0.05)
        told = []
        own = self.namespace[1:] + "/ct_server: CT"
        heard = rospy.Subscriber("/diagnostics", DiagnosticArray,
                                 lambda m: told.extend(s.message for s in m.status if s.name == own))
        held = self.load("ct.nrrd").revision
        # A named pipe simulates a disk that does not answer: it is refused before it is opened.
        os.mkfifo(self.root + "/pipe.nrrd")
        self.assertIn("neither a folder nor a file",
                      self.expect_refused(StatusCode.FILE_ERROR, "pipe.nrrd", held=held))
        big = numpy.zeros((160, 400, 400), "<i2")
        big[:, ::2, ::2] = 1000
        write_nrrd(self.root + "/big.nrrd", big)
        answers = []
        loading = threading.Thread(target=lambda: answers.append(self.load("big.nrrd")))
        loading.start()
        during = []
        while loading.is_alive():
            answer = self.get()
            if not answers:
                during.append(answer.volume.revision)
        loading.join()
        self.assertEqual(answers[0].status.code, StatusCode.OK, answers[0].status.message)
        self.assertTrue(during)
        self.assertEqual(during[0], held)
        wait_for(lambda: told and told[-1] == "CT is held", "the end of the load", 10.0)
        self.assertTrue(any("CT is held; big.nrrd has been loading for" in message for message in told), told)
        heard.unregister()
        self.assertEqual(self.get().volume.revision, answers[0].revision)

    def test_registration_launch(self):
        override = self.folder.name + "/override.yaml"
        with open(override, "w") as stream:
            stream.write("registration: {seed: 3}\nregistratoin: {seed: 4}\n")
        launch = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../launch/registration.launch")

        def loaded(*arguments):
            config = roslaunch.config.ROSLaunchConfig()
            roslaunch.xmlloader.XmlLoader().load(launch, config, argv=list(arguments), verbose=False)
            (rviz,) = [node for node in config.nodes if node.name == "rviz"]
            return config, rviz.args.split()
        config, rviz = loaded("rviz:=true", "fixed_frame:=torso", f"override:={override}")
        self.assertEqual(rviz[rviz.index("--fixed-frame") + 1], "torso")
        self.assertEqual(config.params["/registration/seed"].value, 3)
        self.assertEqual(config.params["/override/registratoin/seed"].value, 4)
        config, rviz = loaded("rviz:=true")
        self.assertEqual(rviz[rviz.index("--fixed-frame") + 1], "us")
        # The copy of an earlier launch must not end the nodes of this one.
        self.assertIn("/override/", config.clear_params)

    def test_shipped_configuration(self):
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../config/nodes/ct_server.yaml")
        with open(path) as stream:
            self.start(**yaml.safe_load(stream))
        self.assertEqual(self.get().status.code, StatusCode.NO_CT)

    def test_diagnostic_period(self):
        self.start(diagnostic_period=0.1)
        reports = []
        own = self.namespace[1:] + "/ct_server: CT"
        heard = rospy.Subscriber("/diagnostics", DiagnosticArray,
                                 lambda m: reports.extend(s for s in m.status if s.name == own))
        wait_for(lambda: len(reports) > 20, "twenty reports", 10.0)
        heard.unregister()

    def test_wrong_parameters_end_it(self):
        for key, value, constraint in (("pth", "x", "is not a parameter"),
                                       ("data_root", self.root + "/missing", "which cannot be opened: No such file"),
                                       ("data_root", self.root + "/ct.nrrd", "must be a folder"),
                                       ("data_root", "missing", "must be the whole path of a folder"),
                                       ("labels", "labels.nrrd", "'path' is not"),
                                       ("label_table", self.root + "/missing.yaml", "missing.yaml"),
                                       ("surface_triangles", 3, "must be in"),
                                       ("decimation", 0, "must be in"),
                                       ("roi", [0, 0, 0, 0.1, 0.1, 0], "differ along each axis"),
                                       ("diagnostic_period", 0.0, "must be in"),
                                       ("ct_frame", "/ct", "without leading /")):
            process = self.start(**{key: value})
            self.assertEqual(process.exit_status(), 2)
            self.assertIn(constraint, process.log())
            self.assertIn(key, process.log())


if __name__ == "__main__":
    rospy.init_node("test_ct_server")
    rostest.rosrun("us_ct_registration", "ct_server", CtServer)
