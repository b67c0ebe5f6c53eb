#!/usr/bin/env python3
"""scripts/overlay_error.py on drawings whose error is known: a disc, drawn by hand into a grey image."""
import pathlib
import sys
import unittest

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import overlay_error

ROWS, COLUMNS, FOCAL, DEPTH_MM, RADIUS_PX = 210, 300, 200.0, 100.0, 40
TEXT_ENDS = ROWS // 7


class Pinhole:
    focal = numpy.array([FOCAL, FOCAL])

    @staticmethod
    def project(points_mm):
        return FOCAL * points_mm[:, :2] / points_mm[:, 2:] + (COLUMNS / 2, ROWS / 2)


def disc(column, row):
    y, x = numpy.mgrid[:ROWS, :COLUMNS]
    return (x - column) ** 2 + (y - row) ** 2 <= RADIUS_PX ** 2


def measures(drawn_at, true_at, text=()):
    """Of a registration that is off by nothing."""
    raw = numpy.full((ROWS, COLUMNS, 3), 90, numpy.uint8)
    drawn = raw.copy()
    drawn[disc(*drawn_at)] = overlay_error.GREEN
    for rows in text:
        drawn[rows] = 10
    case = overlay_error.Case.__new__(overlay_error.Case)
    case.camera, case.off = Pinhole, numpy.eye(4)
    case.points_ct = numpy.array([[0.0, 0.0, DEPTH_MM]])
    case.video = {"frames": [{"T_ct_left": numpy.eye(4).ravel().tolist(), "shift_ct_mm": [0, 0, 0]}]}
    return case.compare(0, drawn, raw, disc(*true_at))


class OverlayError(unittest.TestCase):
    def test_equal_discs(self):
        found = measures((150, 110), (150, 110))
        self.assertEqual((found["outline_worst_px"], found["displacement_px"]), (0, 0))

    def test_displaced_disc(self):
        found = measures((156, 118), (150, 110))
        self.assertAlmostEqual(found["displacement_px"], 10.0)
        self.assertAlmostEqual(found["unexplained_px"], 10.0)
        self.assertAlmostEqual(found["outline_worst_px"], 10.0, delta=1.0)
        self.assertAlmostEqual(found["displacement_px"] * found["mm_per_px"], 10.0 * DEPTH_MM / FOCAL)

    def test_text_that_hides_a_part_of_the_drawing_is_no_error(self):
        found = measures((150, 45), (150, 45), text=[slice(0, TEXT_ENDS)])
        self.assertEqual((found["outline_worst_px"], found["unexplained_px"]), (0, 0))

    def test_a_structure_below_the_text_is_not_in_view(self):
        self.assertEqual(measures((150, -30), (150, -30), text=[slice(0, TEXT_ENDS)]), {"in_view": False})


if __name__ == "__main__":
    unittest.main()
