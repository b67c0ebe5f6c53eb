#!/usr/bin/python3
"""Altered cases: what an alteration must leave as it is, and where things are in the CT."""
import pathlib
import tempfile
import unittest

import numpy as np

import altered_cases
from altered_cases import ALTERATIONS, Image
from self_cases import Grid, write_ct, write_nrrd


class TestAlteredCases(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.case = self.folder / "case_1"
        self.case.mkdir()
        self.random = np.random.default_rng(3)
        # A hot ball in a CT of slices of 1.25 mm, which lie obliquely.
        turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
        self.grid = Grid([30, 34, 41], [0.8, 0.8, 1.25], [-11.0, 20.0, 7.0], turn)
        k, j, i = np.indices((41, 34, 30))
        ball = (i - 15) ** 2 * 0.64 + (j - 17) ** 2 * 0.64 + (k - 22) ** 2 * 1.5625 < 49.0
        write_ct(self.case / "ct.nrrd", np.where(ball, 150.0, 40.0), self.grid)
        self.us = self.random.integers(1, 256, (9, 12, 40)).astype(np.uint8)
        write_nrrd(self.case / "us.nrrd", self.us, ["type: unsigned char", "usct_geometry:=tracked_linear"])
        (self.case / "truth.tfm").write_text("truth\n")
        (self.case / "labels.nrrd").write_text("labels of the CT as it was\n")

    def altered(self, alteration):
        folder = self.folder / alteration
        folder.mkdir()
        altered_cases.write_altered(self.case, folder, alteration)
        return folder

    def centre_mm(self, path):
        """Of what is hotter than its surroundings."""
        ct = Image(path)
        indices = np.stack(np.indices(ct.values.shape)[::-1], -1).reshape(-1, 3)
        weights = np.clip(ct.values.ravel() - 60.0, 0.0, None)
        return (weights @ indices / weights.sum()) @ ct.vectors_mm("space directions") + ct.vectors_mm("space origin")[0]

    def test_only_the_named_image_changes_and_labels_are_left_out(self):
        for alteration, (name, _) in ALTERATIONS.items():
            folder = self.altered(alteration)
            self.assertEqual(sorted(path.name for path in folder.iterdir()), ["ct.nrrd", "truth.tfm", "us.nrrd"])
            for other in {"ct.nrrd", "us.nrrd"} - {name}:
                self.assertEqual((folder / other).read_bytes(), (self.case / other).read_bytes(), alteration)
            changed = Image(folder / name).values.shape != Image(self.case / name).values.shape or \
                not np.array_equal(Image(folder / name).values, Image(self.case / name).values)
            self.assertEqual(changed, alteration != "none", alteration)

    def test_another_display_keeps_what_is_brighter(self):
        order = np.argsort(self.us, axis=None, kind="stable")
        for alteration in ("bright", "dark", "contrast"):
            values = Image(self.altered(alteration) / "us.nrrd").values.ravel()[order]
            self.assertTrue((np.diff(values) >= 0.0).all(), alteration)

    def test_gain_changes_along_the_depth_and_contact_across_the_lines(self):
        falls = Image(self.altered("gainfalls") / "us.nrrd").values - self.us
        unclipped = self.us > 45
        expected = np.broadcast_to(-45.0 * np.arange(40) / 39.0, self.us.shape)
        np.testing.assert_allclose(falls[unclipped], expected[unclipped], atol=0.51)
        lost = Image(self.altered("nocontact") / "us.nrrd").values
        self.assertLessEqual(lost[:, :4].max(), 6.0)
        np.testing.assert_array_equal(lost[:, 4:], self.us[:, 4:])

    def test_the_anatomy_stays_where_it_is(self):
        before = self.centre_mm(self.case / "ct.nrrd")
        for alteration in ("ctslices", "ctsoft"):
            after = self.centre_mm(self.altered(alteration) / "ct.nrrd")
            np.testing.assert_allclose(after, before, atol=0.35, err_msg=alteration)
        slices = Image(self.folder / "ctslices" / "ct.nrrd")
        np.testing.assert_allclose(np.linalg.norm(slices.vectors_mm("space directions"), axis=1), [0.8, 0.8, 5.0])
        self.assertEqual(slices.values.shape, (10, 34, 30))
        soft = Image(self.folder / "ctsoft" / "ct.nrrd").values
        np.testing.assert_allclose(soft[[0, -1]], 40.0, atol=1.0)  # no rim where the CT ends


if __name__ == "__main__":
    unittest.main()
