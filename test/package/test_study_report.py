#!/usr/bin/python3
"""scripts/study_report: what it draws of a study, and that its page is whole and needs nothing else."""
import csv
import html.parser
import importlib.machinery
import importlib.util
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "study_report"
loader = importlib.machinery.SourceFileLoader("study_report", str(SCRIPT))
study_report = importlib.util.module_from_spec(importlib.util.spec_from_loader("study_report", loader))
loader.exec_module(study_report)


def run(error_mm=None, displacement_mm=1.0, wrong=None, method="m", kind="start", expected_mm=None, best_mm=None):
    """A run of a study; refused without `error_mm`, with a candidate that is off by `best_mm`."""
    def errors(mm):
        return None if mm is None else {"mean": mm, "rms": 1.5 * mm, "median": mm, "max": 2.0 * mm}
    return {"method": method, "case": "g_1", "group": "g", "ct_case": "g_1", "kind": kind, "seed": 1, "start": 0,
            "displacement_mm": displacement_mm, "status": "low_confidence" if error_mm is None else "registered",
            "message": "why, <exactly>", "tre_mm": errors(error_mm), "physical_mm": errors(error_mm),
            "expected_tre_mm": None if expected_mm is None else {"rms": expected_mm, "max": 2 * expected_mm},
            "candidates": [] if best_mm is None else [{"tre_mm": errors(best_mm)}], "similarity": 0.5, "overlap": 1.0,
            "measures": {} if wrong is None else {"wrong_probability": wrong}, "evaluations": 7,
            "seconds": {"search": 0.5, "ct": 0.25}, "peak_memory_mib": None}


def study(runs, methods=("m",), pictures=()):
    titles = ("Methods", "By displacement of the start", "By case", "Costs")
    return {"version": "0.1.0",
            "study": {"methods": [{"name": name} for name in methods], "success_mm": 5.0,
                      "starts": {"bin_edges_mm": [0.0, 10.0, 20.0]}},
            "tables": [{"title": title, "header": ["method", "x & y"], "rows": [["m", "< 1"]], "note": "Note."}
                       for title in titles],
            "pictures": list(pictures), "runs": runs}


def pose(angle_deg=0.0, shift=(0.0, 0.0, 0.0), about=(0.0, 0.0, 0.0)):
    """16 numbers, row by row: a rotation about z through a point, then a shift."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    x, y = about[0] - c * about[0] + s * about[1], about[1] - s * about[0] - c * about[1]
    return [c, -s, 0, x + shift[0], s, c, 0, y + shift[1], 0, 0, 1, shift[2], 0, 0, 0, 1]


def case(name="g_1", samples=1000000, truth=None, centre=(10.0, 60.0, 5.0)):
    return {"name": name, "T_us_ct_true": truth or pose(), "centre_us_mm": list(centre), "us_samples": samples,
            "ct_voxels": 5}


def profile(values, method="m"):
    axis = {"offsets": [-1.0, 0.0, 1.0], "values": values}
    return {"method": method, "case": "g_1", "axes": [axis] * 6}


class Page(html.parser.HTMLParser):
    """Reads a page; `left_open` are the elements that are not closed in order, `sources` what it refers to."""
    VOID = {"meta", "img"}

    def __init__(self, text):
        super().__init__()
        self.left_open, self.sources, self.misplaced, self.headings = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.sources += [value for name, value in attributes if name in ("src", "href")]
        if tag not in self.VOID:
            self.left_open.append(tag)

    def handle_endtag(self, tag):
        if not self.left_open or self.left_open.pop() != tag:
            self.misplaced.append(tag)

    def handle_data(self, data):
        if self.left_open and self.left_open[-1] == "h2":
            self.headings.append(data)


class StudyReport(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def report(self, text):
        (self.folder / "study.json").write_text(text)
        return subprocess.run([SCRIPT, self.folder / "study.json", self.folder / "out"], capture_output=True, text=True)

    def test_success_is_counted_by_bins_of_which_the_last_includes_its_end(self):
        runs = [run(1.0, 0.0), run(6.0, 9.9), run(2.0, 10.0), run(None, 15.0), run(4.9, 20.0), run(1.0, 20.5),
                run(1.0, 5.0, kind="half turn")]
        bins = study_report.success_by_bin(runs, [0.0, 10.0, 20.0], 5.0)
        self.assertEqual([count for count, _ in bins], [2, 3])
        self.assertAlmostEqual(bins[0][1], 50.0)
        self.assertAlmostEqual(bins[1][1], 200.0 / 3.0)
        self.assertEqual(study_report.success_by_bin([], [0.0, 10.0], 5.0), [(0, None)])
        at_one_distance = [run(3.0, 9.99999999999962), run(3.0, 10.000000000000295)]
        self.assertEqual(study_report.success_by_bin(at_one_distance, [10.0, 10.0], 5.0), [(2, 100.0)])

    def test_a_cdf_rises_by_the_share_of_each_run_and_refused_runs_never_come(self):
        errors_mm, percent = study_report.error_cdf([run(2.0), run(), run(0.5), run(30.0)])
        self.assertEqual(errors_mm, [0.5, 2.0, 30.0])
        self.assertEqual(percent, [25.0, 50.0, 75.0])

    def test_risk_is_the_share_of_wrong_ones_among_the_most_confident(self):
        # In the order of their probabilities: right, wrong, right (refused, its candidate is right), wrong (no truth).
        runs = [run(None, wrong=0.4, best_mm=1.0), run(1.0, wrong=0.1), run(8.0, wrong=0.2), run(1.0),
                run(None, wrong=0.9, kind="noise")]
        self.assertEqual([(round(c, 6), round(r, 6)) for c, r in study_report.risk_coverage(runs, 5.0)],
                         [(25.0, 0.0), (50.0, 50.0), (75.0, 33.333333), (100.0, 50.0)])

    def test_calibration_takes_the_physical_errors_of_runs_with_both(self):
        runs = [run(2.0, expected_mm=2.5), run(2.0), run(None, expected_mm=1.0)]
        self.assertEqual(study_report.expected_and_physical(runs), [(2.5, 3.0)])

    def test_worst_are_accepted_runs_and_those_without_truth_first(self):
        wrong = run(1.0, kind="noise")
        wrong["tre_mm"] = None
        worst = study_report.worst_runs([run(1.0), run(), run(7.0), wrong])
        self.assertEqual([study_report.mean_of(one["tre_mm"]) for one in worst], [None, 7.0, 1.0])

    def test_the_motion_of_a_start_is_about_the_centre_of_the_targets(self):
        turned = {"T_us_ct_initial": pose(20.0, (3.0, 0.0, 4.0), (10.0, 60.0, 5.0))}
        angle, shift = study_report.start_motion(turned, case())
        self.assertAlmostEqual(angle, 20.0)
        self.assertAlmostEqual(shift, 5.0)
        # A truth of 30 degrees about another point leaves the motion between the two.
        truth = pose(30.0, (7.0, -2.0, 1.0))
        angle, _ = study_report.start_motion(turned, case(truth=truth))
        self.assertAlmostEqual(angle, 10.0)
        self.assertAlmostEqual(study_report.start_motion({"T_us_ct_initial": truth}, case(truth=truth))[1], 0.0)

    def test_starts_are_mapped_by_rotation_and_shift(self):
        starts = [(0.0, 1.0, 1.0), (0.0, 1.0, 9.0), (19.0, 9.9, None), (20.0, 10.0, 2.0)]
        runs = [{**run(error), "T_us_ct_initial": pose(angle, (shift, 0.0, 0.0), (10.0, 60.0, 5.0))}
                for angle, shift, error in starts]
        counts = study_report.success_map(runs, {"g_1": case()}, 5.0, 20.0, 10.0)
        self.assertEqual((counts[0][0], counts[4][4]), ([2, 1], [2, 1]))
        self.assertEqual(sum(count for row in counts for count, _ in row), 4)

    def test_profiles_are_scaled_to_their_range(self):
        self.assertEqual(study_report.scaled_profile({"values": [1.0, 3.0, None]}), [-1.0, 0.0, None])
        self.assertIsNone(study_report.scaled_profile({"values": [1.0, None, 2.0]}))
        self.assertIsNone(study_report.scaled_profile({"values": [1.0, 1.0, 1.0]}))

    def test_plots_appear_with_what_they_need(self):
        runs = [{**run(1.0), "case": case_name, "displacement_mm": 3.0,
                 "T_us_ct_initial": pose(5.0, (2.0, 0.0, 0.0))} for case_name in ("g_1", "g_2")]
        cases = [case(), case("g_2", 2000000)]
        plots = study_report.Plots({**study(runs), "cases": cases, "profiles": [profile([0.1, 0.9, 0.2])]})
        self.assertIn("Capture range", plots.capture_range())
        self.assertIn("Similarity along the axes", plots.profiles())
        self.assertIn("Time against size", plots.size())
        without = study_report.Plots(study(runs))
        self.assertEqual((without.capture_range(), without.profiles(), without.size()), ("", "", ""))
        of_one_size = study_report.Plots({**study(runs), "cases": [case(), case("g_2")], "profiles": []})
        self.assertEqual((of_one_size.profiles(), of_one_size.size()), ("", ""))

    def test_the_page_is_whole_and_needs_no_other_file(self):
        (self.folder / "worst").mkdir()
        from PIL import Image
        Image.new("RGB", (30, 20), "red").save(self.folder / "worst" / "before_after.png")
        picture = {"method": "m", "group": "g", "case": "g_1", "kind": "start", "start": 0, "folder": "worst"}
        runs = [run(1.0, 5.0, 0.1, expected_mm=1.2), run(None, 15.0, 0.8, best_mm=9.0), run(30.0, 12.0, 0.3),
                run(method="<n>")]
        done = self.report(json.dumps(study(runs, ("m", "<n>"), [picture, {**picture, "folder": "gone"}])))
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        text = (self.folder / "out" / "report.html").read_text()
        page = Page(text)
        self.assertEqual((page.left_open, page.misplaced), ([], []))
        self.assertTrue(all(source.startswith("data:image/") for source in page.sources))
        self.assertEqual(sum(source.startswith("data:image/jpeg") for source in page.sources), 1)
        self.assertEqual(page.headings, ["Methods", "By displacement of the start", "Confidence", "Costs",
                                         "Worst accepted runs", "By case"])
        self.assertNotIn("<n>", text)
        for outside in ("http:", "https:", "url(", "@import", "<script"):
            self.assertNotIn(outside, text)

    def test_plots_are_files_as_well(self):
        (self.folder / "study.json").write_text(json.dumps(study([run(1.5), run(best_mm=9.0)])))
        subprocess.run([SCRIPT, self.folder / "study.json", "--plots", self.folder / "plots"], check=True)
        names = {path.name for path in (self.folder / "plots").iterdir()}
        self.assertEqual(names, {"errors.png", "cdf.png", "success.png", "final_against_initial.png", "seconds.png"})
        self.assertTrue((self.folder / "plots/cdf.png").read_bytes().startswith(b"\x89PNG"))

    def test_every_run_is_a_row_of_the_csv(self):
        self.assertEqual(self.report(json.dumps(study([run(1.5), run(best_mm=9.0)]))).returncode, 0)
        with open(self.folder / "out" / "runs.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["tre_mm"] for row in rows], ["1.5", ""])
        self.assertEqual([row["best_tre_mm"] for row in rows], ["1.5", "9.0"])
        self.assertEqual([row["seconds"] for row in rows], ["0.75", "0.75"])
        self.assertEqual(rows[0]["message"], "why, <exactly>")

    def test_a_study_of_negative_trials_alone_has_a_page(self):
        done = self.report(json.dumps(study([run(kind="noise", wrong=0.9)])))
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    @unittest.skipUnless(shutil.which("chromium"), "chromium is not installed")
    def test_chromium_shows_the_page(self):
        self.assertEqual(self.report(json.dumps(study([run(1.5), run(best_mm=9.0)]))).returncode, 0)
        shot = self.folder / "page.png"
        subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--screenshot={shot}",
                        f"--user-data-dir={self.folder / 'profile'}", "--window-size=1280,3000",
                        f"file://{self.folder / 'out' / 'report.html'}"], check=True, capture_output=True, timeout=120)
        from PIL import Image
        with Image.open(shot) as picture:
            colours = picture.convert("RGB").getcolors(picture.width * picture.height)
        self.assertGreater(len(colours), 100)

    def test_refuses_what_is_no_study(self):
        for text in ["", "[]", "{}", '{"runs": [{}]}']:
            done = self.report(text)
            self.assertEqual(done.returncode, 2)
            self.assertFalse((self.folder / "out").exists())
            self.assertIn("study.json: is not the JSON of a study: ", done.stderr)
            self.assertNotIn("Error(", done.stderr)

    def test_a_folder_or_a_missing_file_is_named_in_words(self):
        self.assertEqual(self.report(json.dumps(study([run(1.5)]))).returncode, 0)
        for argument, words in ((self.folder, f"is a folder, must be the study.json that `usct study` writes: "
                                 f"{self.folder / 'study.json'}"),
                                (self.folder / "absent.json", "absent.json: does not exist, must be the study.json")):
            done = subprocess.run([SCRIPT, argument], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2)
            self.assertIn(words, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)


if __name__ == "__main__":
    unittest.main()
