#!/usr/bin/env python3
"""The summary of all tests counts a file of results that a killed test left behind as failed, and all others."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

SUMMARY = pathlib.Path(__file__).resolve().parents[2] / "scripts/summarise_tests.py"
RESULTS = """<testsuite>
  <testcase classname="Volume" name="Reads"/>
  <testcase classname="Volume" name="RefusesNothing"><failure message="expected&#10;an error"/></testcase>
  <testcase classname="RealData" name="Liver" result="skipped"><skipped message="no data"/></testcase>
</testsuite>"""


class TestSummary(unittest.TestCase):
    def summary_of(self, **files):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in files.items():
                (pathlib.Path(folder) / f"{name}.xml").write_text(text)
            return subprocess.run([sys.executable, SUMMARY, folder], capture_output=True, text=True, check=True).stdout

    def test_cases_are_counted_with_their_reasons(self):
        self.assertEqual(self.summary_of(one=RESULTS, two=RESULTS.replace("Volume", "Sweep")).splitlines(),
                         ["skipped  RealData.Liver: no data", "skipped  RealData.Liver: no data",
                          "failed   Volume.RefusesNothing: expected an error",
                          "failed   Sweep.RefusesNothing: expected an error",
                          "test cases: 2 passed, 2 failed, 2 skipped"])

    def test_half_a_file_counts_as_failed(self):
        for half in ("", '<?xml version="1.0"?>\n', RESULTS[:60]):
            lines = self.summary_of(killed=half, whole=RESULTS).splitlines()
            self.assertIn("test cases: 1 passed, 2 failed, 1 skipped", lines)
            self.assertTrue(any(line.startswith("failed   killed.xml: cannot be read") for line in lines), lines)


if __name__ == "__main__":
    unittest.main()
