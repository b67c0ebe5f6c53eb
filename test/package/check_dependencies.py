#!/usr/bin/env python3
"""scripts/dependencies.txt and package.xml name the same dependencies, and those of README.md, or the test fails."""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

project = pathlib.Path(sys.argv[1])
listed = set()
for line in (project / "scripts/dependencies.txt").read_text().splitlines():
    words = line.split("#")[0].split()
    if words and words[0] != "-":
        if len(words) < 2:
            sys.exit(f"dependencies.txt: '{words[0]}' names no package of the archive")
        listed.add(words[0])
# What a reader of README.md types, and the package that has it.
commands = {"rosrun": "rosbash", "roslaunch": "ros-core", "rosservice": "ros-core", "rosbag": "python3-rosbag"}
packages = {word for line in (project / "scripts/dependencies.txt").read_text().splitlines()
            for word in line.split("#")[0].split()[1:]}
missing = {package for command, package in commands.items()
           if command in (project / "README.md").read_text() and package not in packages}
if missing:
    sys.exit(f"README.md needs {sorted(missing)}, which dependencies.txt does not name")
declared = {element.text for element in ElementTree.parse(project / "package.xml").getroot()
            if element.tag.endswith("depend")}
if listed != declared:
    sys.exit(f"only in dependencies.txt: {sorted(listed - declared)}; "
             f"only in package.xml: {sorted(declared - listed)}")
print(f"{len(listed)} dependencies agree")
