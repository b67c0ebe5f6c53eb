#!/usr/bin/python3
"""Transforms, errors and starts of the comparison, without elastix or usct."""
import pathlib
import tempfile
import unittest

import numpy as np

import geometry
import methods
import table


def pose(rotation_vector_rad, translation_mm):
    T = np.eye(4)
    T[:3, :3] = geometry.rotation_matrix(rotation_vector_rad)
    T[:3, 3] = translation_mm
    return T


POSE = pose([0.3, -1.1, 0.7], [-150.0, 12.5, 101.0])
TARGETS = np.random.default_rng(3).normal([5.0, 80.0, -3.0], [15.0, 15.0, 30.0], (200, 3))


class WithFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)


class Rotations(unittest.TestCase):
    def test_a_quarter_turn_about_z_takes_x_to_y(self):
        turned = geometry.rotation_matrix([0, 0, np.pi / 2]) @ [1, 0, 0]
        np.testing.assert_allclose(turned, [0, 1, 0], atol=1e-15)

    def test_euler_angles_are_those_of_itk(self):
        """First about y, then x, then z: y -> (x) z -> stays under a turn about z."""
        np.testing.assert_allclose(geometry.euler_matrix(np.pi / 2, 0, np.pi / 2) @ [0, 1, 0],
                                   [0, 0, 1], atol=1e-15)
        np.testing.assert_allclose(geometry.euler_matrix(np.pi / 2, np.pi / 2, 0) @ [1, 0, 0],
                                   [0, 1, 0], atol=1e-15)


class TransformFiles(WithFolder):
    def test_what_is_written_is_read(self):
        path = self.folder / "a.tfm"
        geometry.write_T_ct_us(POSE, path)
        np.testing.assert_array_equal(geometry.read_T_ct_us(path), POSE)

    def test_the_centre_stays_but_for_the_translation(self):
        path = self.folder / "a.tfm"
        path.write_text("#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
                        "Parameters: 0 -1 0 1 0 0 0 0 1 7 0 0\nFixedParameters: 10 20 30\n")
        moved = geometry.transformed(geometry.read_T_ct_us(path), np.array([[10, 20, 30],
                                                                            [11, 20, 30]]))
        np.testing.assert_allclose(moved, [[17, 20, 30], [17, 21, 30]])

    def test_other_transforms_are_refused(self):
        path = self.folder / "a.tfm"
        path.write_text("Transform: Euler3DTransform_double_3_3\nParameters: 0 0 0 0 0 0\n")
        with self.assertRaisesRegex(ValueError, "Euler3D"):
            geometry.read_T_ct_us(path)

    def test_elastix_applies_what_it_found_after_the_start(self):
        path = self.folder / "TransformParameters.0.txt"
        path.write_text('(Transform "EulerTransform")\n(HowToCombineTransforms "Compose")\n'
                        "(TransformParameters 0 0 1.5707963267948966 1 2 3)\n"
                        '(CenterOfRotationPoint 10 0 0)\n(ComputeZYX "false")\n')
        start = pose([0, 0, 0], [10, 0, 0])
        found = methods.read_elastix_transform(path, start)
        np.testing.assert_allclose(geometry.transformed(found, np.array([[1, 0, 0]])),
                                   [[11, 3, 3]], atol=1e-12)


class Errors(unittest.TestCase):
    def test_the_truth_has_none(self):
        np.testing.assert_allclose(geometry.errors_mm(POSE, POSE, TARGETS), 0, atol=1e-12)

    def test_a_shift_is_its_length_at_each_target(self):
        shifted = POSE @ pose([0, 0, 0], [2, 3, 6])
        np.testing.assert_allclose(geometry.errors_mm(shifted, POSE, TARGETS), 7)

    def test_a_turn_is_the_chord_at_each_target(self):
        turned = POSE @ pose([0, 0, np.pi / 3], [0, 0, 0])  # chord = radius
        np.testing.assert_allclose(geometry.errors_mm(turned, POSE, TARGETS),
                                   np.hypot(TARGETS[:, 0], TARGETS[:, 1]))


class Starts(unittest.TestCase):
    def test_have_the_displacement_asked_for_and_are_rigid(self):
        for displacement in (0.0, 0.5, 10.0, 30.0):
            start = geometry.draw_start(np.random.default_rng(1), POSE, TARGETS, displacement)
            self.assertAlmostEqual(geometry.errors_mm(start, POSE, TARGETS).mean(), displacement,
                                   places=6)
            np.testing.assert_allclose(start[:3, :3] @ start[:3, :3].T, np.eye(3), atol=1e-12)

    def test_depend_on_the_seed_alone(self):
        first, again, other = (geometry.draw_start(np.random.default_rng(seed), POSE, TARGETS, 10.0)
                               for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, again)
        self.assertGreater(geometry.errors_mm(other, first, TARGETS).mean(), 1.0)

    def test_beyond_reach_are_refused(self):
        with self.assertRaisesRegex(ValueError, "1000.0 mm"):
            geometry.draw_start(np.random.default_rng(1), POSE, TARGETS, 1000.0)


class Volumes(WithFolder):
    HEADER = ("NRRD0004\ntype: int16\ndimension: 3\nsizes: 2 2 1\nencoding: raw\n"
              "space directions: (-0.5,0,0) (0,0,2) (0,3,0)\n\n").encode()

    def test_ct_is_clamped_and_keeps_its_header(self):
        path = self.folder / "ct.nrrd"
        path.write_bytes(self.HEADER + np.array([-1000, -150, 40, 900], "<i2").tobytes())
        methods.clamp_ct(path, path, -150, 250)
        self.assertEqual(path.read_bytes(),
                         self.HEADER + np.array([-150, -150, 40, 250], "<i2").tobytes())

    def test_the_pyramid_is_the_same_in_mm_or_in_voxels(self):
        path = self.folder / "ct.nrrd"
        path.write_bytes(self.HEADER)
        self.assertEqual(methods.pyramid("Moving", path, "mm"),
                         "(MovingImagePyramidSchedule 16 4 3 8 2 1 4 1 1 2 1 1)\n")
        self.assertEqual(methods.pyramid("Fixed", path, "voxels"),
                         "(FixedImagePyramidSchedule 8 8 8 4 4 4 2 2 2 1 1 1)\n")


class Tables(unittest.TestCase):
    def test_a_refusal_is_no_success_and_no_error(self):
        runs = [{"status": "registered", "tre_mm": 1.0}, {"status": "registered", "tre_mm": 4.0},
                {"status": "registered", "tre_mm": 40.0}, {"status": "refused"}]
        for run, seconds in zip(runs, (1.0, 2.0, 3.0, 4.0)):
            run.update(seconds=seconds, cpu_seconds=2 * seconds)
        self.assertEqual(table.row(runs, 5.0),
                         ["4", "2.50", "2.50", "4.00", "25 %", "25 %", "50 %", "1", "2.50", "5.00",
                          "-"])


if __name__ == "__main__":
    unittest.main()
