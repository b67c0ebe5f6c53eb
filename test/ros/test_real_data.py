#!/usr/bin/env python3
"""Real data through the whole system: a real CT, with ultrasound made from it for each kidney, registered within 3 mm;
real sweeps of a liver and of a spine phantom, assembled and shown sample by sample, and refused with a stranger's CT.

USCT_TEST_DATA: folder of the data. USCT_TEST_PICTURES: folder for pictures of what was assembled and registered."""
import gzip
import os
import pathlib
import shutil
import tempfile
import time
import unittest

import numpy
import real_sweeps
import rosbag
import yaml
from node_under_test import has_failed, unitrun
from sensor_msgs.msg import PointField
from test_replay import POSES, PROJECT, Acquisition, Recording, System, initial_of, live_video, run, usct, wait_for
from us_ct_registration.msg import StatusCode

DATA = pathlib.Path(os.environ.get("USCT_TEST_DATA", PROJECT / "../shared/data")).resolve()
PICTURES = os.environ.get("USCT_TEST_PICTURES")
CT = DATA / "totalseg_ct/example_ct.nii.gz"
KIDNEYS = {side: DATA / f"totalseg_ct/example_ct_kidney_{side}.nii.gz" for side in ("left", "right")}
LIVER = DATA / "imfusion_liver_sweep"
SPINE = DATA / "plus_us/SpinePhantomFreehand.igs.mha"
WORST_MEAN_MM = 3.0
MM_PER_M = 1000.0
NIFTI_HEADER = 352  # bytes
# Possible positions of a probe: a point of the CT's skin, and the directions of the lateral axis
# and of the beams (LPS); in front of the liver, and behind the third lumbar vertebra.
HELD_AT_LIVER = [-60.0, -288.0, 370.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.1]
HELD_AT_SPINE = [3.7, -46.0, 315.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]


def require(*paths):
    for path in paths:
        if not path.exists():
            raise unittest.SkipTest(f"real data absent: {path} (set USCT_TEST_DATA to the folder that holds the test "
                                    "data)")


def write_transform(path, T_ct_us):
    numbers = " ".join(map(repr, [*T_ct_us[:3, :3].ravel().tolist(), *T_ct_us[:3, 3].tolist()]))
    path.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                    f"Parameters: {numbers}\nFixedParameters: 0 0 0\n")
    return path


class Sweep(Recording):
    """Pictures of a real sweep, as lines of samples in bags, and where its probe may have been held on the CT."""

    def __init__(self, folder, file, pictures, held_at, *options):
        self.pictures = pictures
        super().__init__(folder, CT, "--us", file, *pictures.probe.options(folder / "probe.yaml"), *options)
        self.start = write_transform(folder / "start.tfm", self.T_ct_us(*held_at))
        self.initial = initial_of(self.start)

    def T_ct_us(self, skin_mm, lateral, beams):
        """The pose at which the middle frame's array lies with its middle on the skin."""
        beams = numpy.array(beams) / numpy.linalg.norm(beams)
        T_ct_frame = numpy.eye(4)
        T_ct_frame[:3, :3] = numpy.stack([lateral, beams, numpy.cross(lateral, beams)], -1)
        T_ct_frame[:3, 3] = skin_mm - self.pictures.probe.radius_mm * beams
        return T_ct_frame @ numpy.linalg.inv(self.pictures.T_us_frame()[len(self.pictures.pixels) // 2])

    def stamps_s(self):
        times_s = self.pictures.times_s or [i / 40 for i in range(len(self.pictures.pixels))]
        return [self.start_s + time_s - times_s[0] for time_s in times_s]


class Video(Sweep):
    """The same as live video, and the probe's poses in tf: bags of what a frame grabber and a tracker send. With
    T_probe_pixel tf has the tracked probe, else its array."""

    def __init__(self, folder, file, pictures, held_at, *options, T_probe_pixel=None):
        super().__init__(folder, file, pictures, held_at, *options)
        self.file, self.options = file, [*pictures.probe.options(folder / "probe.yaml"), *options]
        self.T_us_probe = pictures.T_us_frame() if T_probe_pixel is None else \
            pictures.T_us_pixel @ numpy.linalg.inv(T_probe_pixel)

    def next_bag(self, pose, pause_s=60):
        self.start_s += 1000
        bag = self.folder / f"{self.start_s}.bag"
        live_video.write(bag, self.pictures.pixels, self.stamps_s(), self.T_us_probe,
                         live_video.matrix_of_euler(POSES[pose]), pause_s)
        return bag

    def described(self, **parameters):
        self.pictures.probe.file = self.folder / "probe.yaml"
        # These sweeps are compared image by image with what is recorded of them.
        return live_video.describe(self.folder / "images.yaml", self.pictures.probe, self.pictures.pixels[0],
                                   correct_lag=False, repeat_tolerance=0.0, **parameters)

    def converted(self):
        """Lines of samples as `usct convert` makes them of the file, frames x lines x samples."""
        path = self.folder / "converted.nrrd"
        run([usct(), "convert", str(self.file), str(path), *map(str, self.options), "--quiet"], None)
        return live_video.Sweep(path)


def positions_mm(poses):
    return MM_PER_M * numpy.array([[pose.position.x, pose.position.y, pose.position.z] for pose in poses])


def points_of(cloud):
    """Points with x, y, z in mm and intensity."""
    names = [(field.name, field.offset, field.datatype) for field in cloud.fields]
    assert names == [(name, 4 * i, PointField.FLOAT32) for i, name in enumerate(["x", "y", "z", "intensity"])], names
    points = numpy.frombuffer(cloud.data, "<f4").reshape(cloud.height * cloud.width, cloud.point_step // 4)
    return MM_PER_M * points[:, :3].astype(float), points[:, 3]


class TestRealData(unittest.TestCase):
    def setUp(self):
        require(CT)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_real_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.began_s = time.monotonic()

    def start(self, recording, *arguments):
        self.system = System(self.folder, recording)
        self.addCleanup(self.end)
        self.show()
        self.system.start_master()
        self.system.start_nodes("preset:=patient", f"rviz:={str(self.rviz).lower()}", *arguments)
        self.system.client("ready")

    def end(self):
        self.system.stop_all()
        self.system.stop("screen")
        if has_failed(self):
            print(self.system.log())
        print(f"{self._testMethodName}: {time.monotonic() - self.began_s:.1f} s")

    def show(self):
        """rviz on a screen of its own, if pictures are wanted."""
        self.rviz = bool(PICTURES) and all(map(shutil.which, ("Xvfb", "rviz", "import")))
        if not self.rviz:
            return
        self.system.start("screen", "Xvfb", "-displayfd", "1", "-screen", "0", "1400x900x24")
        log = self.folder / "screen.log"
        number = wait_for(lambda: next(filter(str.isdigit, log.read_text().split("\n")[:-1]), None), "Xvfb")
        self.system.environment.update(DISPLAY=f":{number}", LIBGL_ALWAYS_SOFTWARE="1", QT_X11_NO_MITSHM="1")

    def draw(self, name, us, transform, *options):
        if not PICTURES:
            return
        os.makedirs(PICTURES, exist_ok=True)
        run([usct(), "slices", "--us", str(us), "--ct", str(CT), "--transform", str(transform), "--quiet", "--output",
             f"{PICTURES}/{name}.png", *map(str, options)], None)
        if self.rviz:
            wait_for(lambda: "/rviz" in run(["rostopic", "info", "/us/cloud"], self.system.environment), "rviz")
            time.sleep(5)  # until rviz has drawn its messages
            run(["import", "-window", "root", f"{PICTURES}/{name}_rviz.png"], self.system.environment)

    def labels(self):
        """One label map of both kidneys, 1 and 2, for their surfaces."""
        left, right = [gzip.decompress(path.read_bytes()) for path in KIDNEYS.values()]
        voxels = [numpy.frombuffer(content, "<f8", offset=NIFTI_HEADER) for content in (left, right)]
        path = self.folder / "kidneys.nii"
        path.write_bytes(left[:NIFTI_HEADER] + (voxels[0] + 2 * voxels[1]).tobytes())
        return path

    def kidney(self, side):
        folder = self.folder / side
        folder.mkdir()
        phantom = ["--scene", "from-ct", "--seed", "1", "--size", "100", "48", "31", "--ct", CT, "--labels",
                   KIDNEYS[side],
                   "--label", "1=cortex", "--kidney-label", "1"]
        # The start is 10 mm off.
        return Acquisition(folder, phantom, shift_mm=6.0, ct=CT)

    def test_each_kidney_of_a_real_ct_is_found_in_ultrasound_made_from_it(self):
        require(*KIDNEYS.values())
        kidneys = {side: self.kidney(side) for side in KIDNEYS}
        kidneys["right"].start_s = 5000
        self.start(kidneys["left"], f"ct_labels:={self.labels()}")
        for pose, (side, kidney) in enumerate(kidneys.items()):
            self.system.acquisition = kidney
            self.system.play(pose)
            self.system.client("initial", kidney.initial)
            began_s = time.monotonic()
            answer = run(["rosservice", "call", "/register"], self.system.environment)
            took_s = time.monotonic() - began_s
            self.assertTrue(answer.startswith("success: True"), answer[:2000])
            print(f"{side} kidney, {took_s:.1f} s:", yaml.safe_load(answer)["message"])
            print(self.system.client("ct_in_tf", kidney.case / "targets_ct.csv", WORST_MEAN_MM))
            found = kidney.case / "found.tfm"
            self.system.client("found", found)
            self.draw(f"kidney_{side}", kidney.case / "us.nrrd", found, "--points", kidney.case / "targets.csv")

    def seen(self, stamp_s):
        """The volume and its clouds as a third party receives them, or None while they are not of that time."""
        bag = self.folder / "seen.bag"
        topics = "/us/volume", "/us/cloud", "/us/volume_cloud"
        run(["rosbag", "record", "--quiet", "--limit", "1", "--output-name", str(bag), *topics],
            self.system.environment)
        with rosbag.Bag(str(bag)) as recorded:
            found = {topic: message for topic, message, _ in recorded.read_messages()}
        stamps = [message.header.stamp.to_sec() for message in found.values()]
        return [found[topic] for topic in topics] if numpy.allclose(stamps, stamp_s, atol=1e-4, rtol=0) else None

    def expect_volume(self, volume, sweep):
        """Compares the volume with the file frame by frame."""
        frames, (lines, samples, _) = len(sweep.pictures.pixels), sweep.pictures.probe.points_mm().shape
        self.assertEqual((volume.frames, volume.lines, volume.samples), (frames, lines, samples))
        self.assertEqual(volume.header.frame_id, "us")
        stamps_s = [stamp.to_sec() for stamp in volume.frame_stamps]
        numpy.testing.assert_allclose(stamps_s, sweep.stamps_s(), rtol=0, atol=1e-5)
        self.assertEqual(volume.header.stamp, volume.frame_stamps[-1])
        data = numpy.frombuffer(volume.data, numpy.uint8).reshape(frames, lines, samples)
        # Brightness is rounded.
        numpy.testing.assert_allclose(data, sweep.pictures.samples(), rtol=0, atol=0.6)
        self.assertGreater(data.std(), 10)
        numpy.testing.assert_allclose(positions_mm(volume.frame_poses), sweep.pictures.T_us_frame()[:, :3, 3], rtol=0,
                                      atol=0.05)

    def expect_cloud(self, cloud, sweep, pose):
        """The middle frame, and the middle line of all others, at their poses by the robot."""
        self.assertEqual(cloud.header.frame_id, "patient")
        probe = sweep.pictures.probe
        step = int(numpy.ceil(0.5 / probe.spacing_mm))
        frame, line = len(sweep.pictures.pixels) // 2, probe.lines // 2

        def crossed(grid):
            grid = grid[:, :, ::step]
            others = numpy.delete(grid[:, line], frame, axis=0)
            return numpy.concatenate([grid[frame].reshape(-1, *grid.shape[3:]), others.reshape(-1, *grid.shape[3:])])
        T = live_video.matrix_of_euler(POSES[pose])
        points_mm, intensities = points_of(cloud)
        expected_mm = crossed(sweep.pictures.points_us_mm()) @ T[:3, :3].T + T[:3, 3]
        self.assertEqual(points_mm.shape, expected_mm.shape)
        apart_mm = numpy.linalg.norm(points_mm - expected_mm, axis=1)
        print(f"cloud: {len(points_mm)} points, at most {apart_mm.max():.3f} mm from where the geometry has them")
        self.assertLess(apart_mm.max(), 0.1)
        numpy.testing.assert_allclose(intensities, crossed(sweep.pictures.samples()), rtol=0, atol=0.6)

    def expect_volume_cloud(self, cloud, sweep, pose):
        """The whole sweep at its poses by the robot, averaged to 2 mm."""
        self.assertEqual(cloud.header.frame_id, "patient")
        T = live_video.matrix_of_euler(POSES[pose])
        points_mm, intensities = points_of(cloud)
        recorded_mm = sweep.pictures.points_us_mm().reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
        samples = sweep.pictures.samples()
        print(f"volume cloud: {len(points_mm)} points of {samples.size} samples")
        self.assertLess(len(points_mm), samples.size / 4)
        # Points are in the middle of cells, and an incomplete cell at an end is left out.
        for extreme in (numpy.min, numpy.max):
            numpy.testing.assert_allclose(extreme(points_mm, 0), extreme(recorded_mm, 0), rtol=0, atol=4.0)
        self.assertAlmostEqual(intensities.mean(), samples.mean(), delta=0.02 * samples.mean())

    def expect_refusal(self, sweep):
        """Expects a refusal with the CT of another person, though the initial alignment is plausible."""
        self.system.client("initial", sweep.initial)
        began_s = time.monotonic()
        answer = yaml.safe_load(run(["rosservice", "call", "/register"], self.system.environment))
        result = answer["result"]
        measures = ", ".join(f"{measure['name']} {measure['value']:.3g}" for measure in result["measures"])
        print(f"/register, {time.monotonic() - began_s:.1f} s: {answer['message']} ({measures})")
        self.assertFalse(answer["success"])
        self.assertIn(result["status"]["code"], (StatusCode.LOW_CONFIDENCE, StatusCode.NO_OVERLAP))
        self.assertGreater(len(answer["message"].split()), 3)
        self.assertEqual(answer["message"], result["status"]["message"])
        for transform in (result["transform"], result["fixed_transform"]):
            self.assertFalse(any(number for part in transform.values() for number in part.values()), transform)
        print(self.system.client("no_ct_in_tf"))

    def expect_seen_and_refused(self, name, sweep, *arguments):
        override = self.folder / "override.yaml"
        override.write_text("us_ingest: {pose_frame: us}\n")
        self.start(sweep, "run_us_cloud:=true", f"override:={override}", *arguments)
        self.system.play(0)
        volume, cloud, volume_cloud = wait_for(lambda: self.seen(sweep.stamps_s()[-1]), "the volume and its clouds")
        print(f"{name}: {volume.frames} frames of {volume.lines} lines of {volume.samples} samples, "
              f"{sweep.stamps_s()[-1] - sweep.stamps_s()[0]:.3f} s")
        self.expect_volume(volume, sweep)
        self.expect_cloud(cloud, sweep, 0)
        self.expect_volume_cloud(volume_cloud, sweep, 0)
        self.expect_refusal(sweep)
        assembled = self.folder / f"{name}.nrrd"
        run([usct(), "bag", "read", str(self.folder / "seen.bag"), "--us", str(assembled)], None)
        self.draw(name, assembled, sweep.start, "--pixel", 4 * sweep.pictures.probe.pixel_mm[0] / 3,
                  "--slice-thickness", "2", "--hole-fill", "2")
        return volume

    def expect_as_converted(self, volume, sweep):
        """A sweep that was assembled live has the brightness that the tool reads from the file, bit by bit."""
        converted = sweep.converted()
        data = numpy.frombuffer(volume.data, numpy.uint8).reshape(volume.frames, volume.lines, volume.samples)
        self.assertTrue((data == converted.samples).all())
        numpy.testing.assert_allclose(positions_mm(volume.frame_poses), converted.T_us_frame[:, :3, 3], rtol=0,
                                      atol=0.05)

    def liver(self):
        """The images of the liver sweep, and a file with them and their poses."""
        require(LIVER)
        try:
            pictures = real_sweeps.liver(LIVER)
        except OSError as error:
            self.skipTest(f"the video cannot be read here: {error}")
        file = self.folder / "liver.igs.mha"
        real_sweeps.write_sequence(file, pictures)
        return file, pictures

    def spine(self):
        """The images of the spine sweep, and a file with its calibration."""
        require(SPINE)
        calibration = self.folder / "calibration.xml"
        real_sweeps.write_calibration(calibration)
        return real_sweeps.spine(SPINE), calibration

    def test_liver_sweep_is_assembled_shown_and_refused_with_the_ct_of_a_stranger(self):
        file, pictures = self.liver()
        self.expect_seen_and_refused("liver", Sweep(self.folder, file, pictures, HELD_AT_LIVER))

    def test_spine_sweep_with_poses_in_tf_is_assembled_shown_and_refused_with_the_ct_of_a_stranger(self):
        pictures, calibration = self.spine()
        self.expect_seen_and_refused("spine", Sweep(self.folder, SPINE, pictures, HELD_AT_SPINE,
                                                    "--calibration", calibration, "--poses", "tf"))

    def test_spine_sweep_as_live_video_is_what_the_tool_makes_of_the_file(self):
        pictures, calibration = self.spine()
        video = Video(self.folder, SPINE, pictures, HELD_AT_SPINE, "--calibration", calibration,
                      T_probe_pixel=real_sweeps.spine_calibration())
        volume = self.expect_seen_and_refused("spine_video", video,
                                              video.described(calibration=str(calibration), to="Probe"))
        self.expect_as_converted(volume, video)

    def test_liver_sweep_as_live_video_is_what_the_tool_makes_of_the_file(self):
        file, pictures = self.liver()
        video = Video(self.folder, file, pictures, HELD_AT_LIVER)
        volume = self.expect_seen_and_refused("liver_video", video, video.described())
        self.expect_as_converted(volume, video)


if __name__ == "__main__":
    unitrun("real_data", TestRealData)
