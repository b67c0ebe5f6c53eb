#!/usr/bin/python3
"""Cases of real ultrasound against itself, from a small sweep of known content; without real data."""
import gzip
import pathlib
import tempfile
import unittest
from unittest import mock

import numpy as np

import self_cases
from self_cases import geometry


# In place of a map that turns, so that the test knows what to expect: brightness 0 to 255 as 0 to 510 HU.
BRIGHTER_BY_TWICE = np.array([0.0, 255.0]), np.array([0.0, 510.0])


class Sweep:
    """Parallel frames of a linear array over a ball, brighter than what is around it."""

    CENTRE_MM, RADIUS_MM = np.array([4.0, 30.0, 20.0]), 12.0

    def __init__(self):
        self.probe = self_cases.real_sweeps.Probe("linear", 0.0, 41, 1.2, 0.8, 80, [0, 0], [1, 1])
        self.pixels = np.zeros((40, 1, 1))

    def T_us_frame(self):
        T = np.tile(np.eye(4), (40, 1, 1))
        T[:, 2, 3] = np.arange(40.0)
        return T

    def points_us_mm(self):
        x, y = np.moveaxis(self.probe.points_mm(), -1, 0)
        return np.stack([np.stack([x, y, np.full_like(x, z)], -1) for z in np.arange(40.0)])

    def samples(self):
        distance_mm = np.linalg.norm(self.points_us_mm() - self.CENTRE_MM, axis=-1)
        return np.where(distance_mm < self.RADIUS_MM, 180.0, 60.0)


def read_nrrd(path):
    header, data = path.read_bytes().split(b"\n\n", 1)
    lines = header.decode().split("\n")[1:]
    fields = dict(line.split(":=" if ":=" in line else ": ", 1) for line in lines)
    kind = {"short": "<i2", "unsigned char": "u1"}[fields["type"]]
    return np.frombuffer(gzip.decompress(data), kind).reshape(list(map(int, fields["sizes"].split()))[::-1]), fields


def vectors(text):
    return np.array([list(map(float, part.strip("()").split(","))) for part in text.split()])


class TestSelfCases(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_frames_go_to_one_part_in_blocks(self):
        for seed in range(20):
            ct, us = self_cases.chosen_frames(np.random.default_rng(seed), 50, 2, 0.6)
            both = np.sort(np.concatenate([ct, us]))
            np.testing.assert_array_equal(both, np.arange(both[0], both[-1] + 1))
            self.assertGreaterEqual(len(both), 30)
            self.assertLessEqual(abs(len(ct) - len(us)), 2)
            self.assertTrue(all(frame + 1 in ct or frame - 1 in ct for frame in ct[1:-1]))
            self.assertFalse(any({frame, frame + 1, frame + 2} <= set(ct) for frame in ct))

    def test_smoothing_spreads_a_point_as_a_gaussian_and_does_not_wrap(self):
        volume = np.zeros((9, 30, 40))
        volume[4, 2, 20] = 1.0
        result = self_cases.smoothed(volume, [0.0, 1.5, 3.0])
        expected = np.exp(-0.5 * (2 / 1.5) ** 2 - 0.5 * (3 / 3.0) ** 2) / (2 * np.pi * 1.5 * 3.0)
        self.assertAlmostEqual(result[4, 4, 23], expected, places=5)
        self.assertAlmostEqual(result[4, 29, 20], 0.0, places=6)
        self.assertAlmostEqual(result[3, 2, 20], 0.0, places=12)

    def test_the_map_of_brightness_turns_twice(self):
        for seed in range(20):
            knots, hu = self_cases.brightness_to_hu(np.random.default_rng(seed), np.linspace(0.0, 255.0, 1000))
            self.assertTrue((np.diff(knots) > 0).all())
            rises = np.sign(np.diff(hu)).tolist()
            self.assertIn(rises, ([1, -1, 1], [-1, 1, -1]))

    def test_rotations_are_rotations(self):
        random = np.random.default_rng(1)
        for R in [self_cases.tilt(random) for _ in range(5)] + [self_cases.quarter_turns(random) for _ in range(9)]:
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
            self.assertAlmostEqual(np.linalg.det(R), 1.0)

    def test_the_truth_maps_the_ball_of_the_ultrasound_to_that_of_the_ct(self):
        sweep = Sweep()
        for seed in (1, 2):
            folder = self.folder / f"self_{seed}"
            folder.mkdir()
            with mock.patch.object(self_cases, "brightness_to_hu", return_value=BRIGHTER_BY_TWICE):
                self_cases.write_case(folder, sweep, seed, 2, 1.0)
            T_ct_us = geometry.read_T_ct_us(folder / "truth.tfm")
            volume, fields = read_nrrd(folder / "ct.nrrd")
            axes, origin = vectors(fields["space directions"]), vectors(fields["space origin"])[0]
            centre_ct = geometry.transformed(T_ct_us, sweep.CENTRE_MM[None])[0]
            indices = np.stack(np.meshgrid(*map(np.arange, volume.shape[::-1]), indexing="ij"), -1)
            distance_mm = np.linalg.norm(indices @ axes + origin - centre_ct, axis=-1)
            voxels = np.transpose(volume, (2, 1, 0))
            inside = voxels[distance_mm < sweep.RADIUS_MM - 4.0]
            around = voxels[(distance_mm > sweep.RADIUS_MM + 4.0) & (distance_mm < sweep.RADIUS_MM + 8.0)]
            self.assertAlmostEqual(inside.mean(), 360.0, delta=5.0)
            self.assertAlmostEqual(around.mean(), 120.0, delta=5.0)
            # The edge is half way: a ball that is off by 3 mm would be seen on both sides of it.
            right = (voxels > 240.0) == (distance_mm < sweep.RADIUS_MM)
            near = (distance_mm < sweep.RADIUS_MM + 8.0) & (abs(distance_mm - sweep.RADIUS_MM) > 3.0)
            self.assertGreater(right[near].mean(), 0.97)
            targets_us = geometry.read_points_mm(folder / "targets.csv")
            np.testing.assert_allclose(geometry.read_points_mm(folder / "targets_ct.csv"),
                                       geometry.transformed(T_ct_us, targets_us), atol=1e-9)
            np.testing.assert_allclose(np.linalg.norm(targets_us - targets_us.mean(axis=0), axis=1), 25.0, atol=0.5)

    def test_the_ultrasound_keeps_its_frames_and_poses(self):
        sweep = Sweep()
        self_cases.write_case(self.folder, sweep, 7, 2, 0.8)
        data, fields = read_nrrd(self.folder / "us.nrrd")
        poses = np.array([list(map(float, pose.split())) for pose in fields["frame_poses_mm"].split(";")])
        frames = poses[:, 11].astype(int)
        np.testing.assert_array_equal(data, sweep.samples()[frames].astype(np.uint8))
        self.assertEqual(fields["usct_geometry"], "tracked_linear")
        again = self.folder / "again"
        again.mkdir()
        self_cases.write_case(again, sweep, 7, 2, 0.8)
        self.assertEqual(read_nrrd(again / "ct.nrrd")[0].tobytes(), read_nrrd(self.folder / "ct.nrrd")[0].tobytes())


if __name__ == "__main__":
    unittest.main()
