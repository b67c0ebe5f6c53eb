#!/usr/bin/python3
"""scripts/study_cases: makes the cases that each study in studies/ names, once, with options that `usct phantom` has.

scripts/study_slurm: says so where there is no Slurm, before it makes anything.
"""
import fnmatch
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import yaml

PROJECT = pathlib.Path(__file__).resolve().parents[2]
STUDIES = sorted((PROJECT / "studies").glob("*.yaml"))
OPTIONS = (PROJECT / "src/tools/phantom.cpp").read_text()
# Notes its arguments in place of making a phantom.
MAKER = '#!/bin/sh\nfor word; do case $last in --output) folder=$word;; esac; last=$word; done\n' \
        'mkdir "${folder:-$1}" && echo "$@" >> "$LOG"\n'


class StudyCases(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.log = self.folder / "log"
        maker = self.folder / "maker"
        maker.write_text(MAKER)
        maker.chmod(0o755)
        self.variables = {**os.environ, "USCT": str(maker), "USCT_GENERATOR": str(maker), "LOG": str(self.log)}

    def make(self, study, **variables):
        return subprocess.run([PROJECT / "scripts/study_cases", study, self.folder / study], capture_output=True,
                              text=True, env={**self.variables, **variables})

    def test_makes_the_cases_that_each_study_names_and_no_others(self):
        self.assertGreater(len(STUDIES), 5)
        for path in STUDIES:
            done = self.make(path.stem)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            made = {"cases/" + case.name for case in (self.folder / path.stem / "cases").iterdir()}
            patterns = yaml.safe_load(path.read_text())["cases"]
            found = {pattern: fnmatch.filter(made, pattern) for pattern in patterns}
            self.assertTrue(all(found.values()), f"{path.stem}: {found}")
            self.assertEqual(set().union(*found.values()), made)

    def test_options_are_those_of_usct_phantom(self):
        for path in STUDIES:
            self.make(path.stem)
        words = {word for word in self.log.read_text().split() if word.startswith("--")}
        self.assertIn("--deformation", words)
        self.assertEqual([word for word in sorted(words) if f'"{word}"' not in OPTIONS], [])

    def test_what_is_there_is_not_made_again(self):
        self.make("transfer", SEEDS="7")
        first = self.log.read_text()
        self.assertEqual(first.count("\n"), 3)
        self.make("transfer", SEEDS="7")
        self.assertEqual(self.log.read_text(), first)
        self.assertFalse(list((self.folder / "transfer/cases").glob("*.part")))

    def test_cases_of_other_seeds_are_not_taken_into_a_study(self):
        self.assertEqual(self.make("transfer", SEEDS="7 8").returncode, 0)
        before = self.log.read_text()
        for seeds in ("7", ""):
            done = self.make("transfer", SEEDS=seeds)
            self.assertEqual(done.returncode, 1)
            self.assertIn("has another seed than transfer", done.stderr)
        self.assertEqual(self.log.read_text(), before)

    def test_what_is_missing_is_named(self):
        self.assertEqual(self.make("no_study").returncode, 2)
        done = self.make("transfer", USCT_GENERATOR="")
        self.assertEqual(done.returncode, 1)
        self.assertIn("USCT_GENERATOR", done.stderr)
        done = self.make("comparison", USCT="no_such_tool")
        self.assertEqual(done.returncode, 1)
        self.assertIn("USCT", done.stderr)


class StudySlurm(unittest.TestCase):
    def test_without_slurm_nothing_is_made(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "study.yaml").write_text("cases: [a]\n")
            tools = folder / "tools"
            tools.mkdir()
            for tool in ("bash", "realpath", "dirname", "basename", "mkdir"):
                (tools / tool).symlink_to(shutil.which(tool))
            done = subprocess.run([shutil.which("bash"), PROJECT / "scripts/study_slurm", folder / "study.yaml", "2"],
                                  capture_output=True, text=True, env={"PATH": str(tools), "USCT": "/bin/true"})
            self.assertEqual(done.returncode, 1)
            self.assertIn("sbatch is not on the path", done.stderr)
            self.assertFalse((folder / "study").exists())


if __name__ == "__main__":
    unittest.main()
