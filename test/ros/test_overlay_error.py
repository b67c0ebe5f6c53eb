#!/usr/bin/env python3
"""The overlay on a synthetic endoscope, through all nodes: as far off as the error of the registration predicts."""
import pathlib
import shutil
import sys
import tempfile
import unittest

import rosunit

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import node_under_test
import overlay_case
import test_replay


class TestOverlayError(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_overlay_"))
        self.case = overlay_case.OverlayCase(
            self.folder, "--seed", "1", "--endoscope-size", "640", "360", "--endoscope-frames", "3",
            "--endoscope-rate", "2")
        self.system = test_replay.System(self.folder, self.case)

    def tearDown(self):
        overlay_case.stop(self.system)
        if node_under_test.has_failed(self):
            print(self.system.log())
        shutil.rmtree(self.folder)

    def test_the_overlay_is_as_far_off_as_the_registration(self):
        overlay_case.start(self.system)
        answer = overlay_case.register(self.system)
        self.assertTrue(answer.startswith("success: True"), answer[:2000])
        measures = overlay_case.measure(self.system)
        self.assertEqual(measures["images"], 3)
        # 5 px are about 1 mm here. The middle of the drawn region lies where the registration's error predicts it.
        self.assertLess(measures["unexplained_px"], 1.0)
        self.assertLess(measures["displacement_mm"], 2.0)
        self.assertLess(measures["outline_mm"], 2.0)


if __name__ == "__main__":
    rosunit.unitrun(node_under_test.PACKAGE, "overlay_error", TestOverlayError)
