#!/usr/bin/env python3
"""check_debian.py reports each disagreement: this project's files with one of them changed."""
import pathlib
import shutil
import tempfile
import unittest

import check_debian

PROJECT = pathlib.Path(__file__).resolve().parents[2]
FILES = ("package.xml", "CMakeLists.txt", "debian/control", "debian/changelog", "scripts/dependencies.txt")


class CheckDebian(unittest.TestCase):
    def problems(self, file, old, new):
        with tempfile.TemporaryDirectory() as folder:
            for name in FILES:
                copy = pathlib.Path(folder, name)
                copy.parent.mkdir(exist_ok=True)
                shutil.copy(PROJECT / name, copy)
            changed = pathlib.Path(folder, file)
            text = changed.read_text()
            self.assertIn(old, text)
            changed.write_text(text.replace(old, new, 1))
            return check_debian.check(pathlib.Path(folder))

    def test_nothing_is_wrong(self):
        self.assertEqual(self.problems("package.xml", "</package>", "</package>"), [])

    def test_a_package_to_build_is_missing(self):
        self.assertEqual(self.problems("debian/control", " libpagmo-dev,\n", ""),
                         ["Build-Depends: libpagmo-dev is missing"])

    def test_a_package_to_build_is_not_needed(self):
        self.assertEqual(self.problems("package.xml", "<depend>libpagmo-dev</depend>", ""),
                         ["Build-Depends: libpagmo-dev is not needed"])

    def test_a_package_for_those_who_build_on_it_is_missing(self):
        self.assertEqual(self.problems("CMakeLists.txt", "USCT_ROS_PACKAGES actionlib", "USCT_ROS_PACKAGES rostest actionlib"),
                         ["libus-ct-registration-dev: librostest-dev is missing"])

    def test_a_package_at_run_time_is_missing(self):
        self.assertEqual(self.problems("debian/control", "Recommends: ros-core, rviz", "Recommends: ros-core"),
                         ["no package depends on rviz"])

    def test_versions(self):
        found = self.problems("debian/changelog", "(0.1.0)", "(0.2.0)")
        self.assertEqual(len(found), 1)
        self.assertIn("has version 0.2.0, package.xml 0.1.0", found[0])
        found = self.problems("debian/control", "libus-ct-registration-core0.1", "libus-ct-registration-core0.2")
        self.assertIn("no package libus-ct-registration-core0.1, as the library's SONAME has it", found)


if __name__ == "__main__":
    unittest.main()
