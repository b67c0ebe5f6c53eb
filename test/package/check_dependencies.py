#!/usr/bin/env python3
"""scripts/dependencies.txt and package.xml name the same dependencies, or the test fails."""
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
declared = {element.text for element in ElementTree.parse(project / "package.xml").getroot()
            if element.tag.endswith("depend")}
if listed != declared:
    sys.exit(f"only in dependencies.txt: {sorted(listed - declared)}; "
             f"only in package.xml: {sorted(declared - listed)}")
print(f"{len(listed)} dependencies agree")
