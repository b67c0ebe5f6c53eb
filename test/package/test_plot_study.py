#!/usr/bin/python3
"""scripts/plot_study: what it plots of a study, and that it writes the pictures."""
import importlib.machinery
import importlib.util
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "plot_study"
loader = importlib.machinery.SourceFileLoader("plot_study", str(SCRIPT))
plot_study = importlib.util.module_from_spec(importlib.util.spec_from_loader("plot_study", loader))
loader.exec_module(plot_study)


def run(group, mean_mm=None, expected_mm=None):
    """A run of a study; refused without `mean_mm`."""
    return {"group": group,
            "tre_mm": None if mean_mm is None else {"mean": mean_mm, "rms": 1.5 * mean_mm, "max": 2 * mean_mm},
            "physical_mm": None if mean_mm is None else {"mean": 2 * mean_mm, "rms": 3 * mean_mm, "max": 4 * mean_mm},
            "expected_tre_mm": None if expected_mm is None else {"rms": expected_mm, "max": 2 * expected_mm}}


class PlotStudy(unittest.TestCase):
    def plot(self, text):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name)
        (path / "study.json").write_text(text)
        done = subprocess.run([SCRIPT, path / "study.json", path / "plots"], capture_output=True, text=True)
        pictures = sorted(p.name for p in (path / "plots").glob("*.png") if p.read_bytes().startswith(b"\x89PNG"))
        return done, pictures

    def test_a_cdf_rises_by_the_share_of_each_run_and_refused_runs_never_come(self):
        errors_mm, percent = plot_study.error_cdf([run("a", 2.0), run("a"), run("a", 0.5), run("a", 30.0)])
        self.assertEqual(errors_mm, [0.5, 2.0, 30.0])
        self.assertEqual(percent, [25.0, 50.0, 75.0])

    def test_calibration_takes_the_physical_errors_of_runs_with_both(self):
        runs = [run("a", 2.0, 2.5), run("a", 2.0), run("a", None, 1.0)]
        self.assertEqual(plot_study.expected_and_physical(runs), [(2.5, 6.0)])

    def test_groups_are_those_of_the_runs(self):
        groups = plot_study.runs_by_group({"runs": [run("b"), run("a", 1.0), run("b", 2.0)]})
        self.assertEqual([(name, len(runs)) for name, runs in groups.items()], [("a", 1), ("b", 2)])

    def test_writes_both_plots(self):
        done, pictures = self.plot(json.dumps({"runs": [run("a", 1.0, 1.2), run("b", 30.0, 14.0), run("b")]}))
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(pictures, ["calibration.png", "tre_cdf.png"])

    def test_leaves_out_the_calibration_if_no_run_expects_an_error(self):
        done, pictures = self.plot(json.dumps({"runs": [run("a", 1.0), run("b")]}))
        self.assertEqual((done.returncode, pictures), (0, ["tre_cdf.png"]), done.stderr)

    def test_refuses_what_is_no_study(self):
        for text in ["", "[]", "{}", '{"runs": [{}]}']:
            done, pictures = self.plot(text)
            self.assertEqual((done.returncode, pictures), (1, []))
            self.assertIn("study.json: is not the JSON of a study", done.stderr)


if __name__ == "__main__":
    unittest.main()
