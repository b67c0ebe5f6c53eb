#!/usr/bin/env python3
"""Counts the test cases below a folder of JUnit XML files and lists the skipped ones with reasons."""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def main():
    passed = failed = 0
    skipped = []
    for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.xml")):
        for case in ElementTree.parse(path).iter("testcase"):
            name = f"{case.get('classname')}.{case.get('name')}"
            skip = case.find("skipped")
            if skip is not None or case.get("result") == "skipped":
                reason = (skip.get("message") or skip.text or "") if skip is not None else ""
                skipped.append(f"{name}: {' '.join(reason.split())}")
            elif case.find("failure") is not None or case.find("error") is not None:
                failed += 1
            else:
                passed += 1
    for line in skipped:
        print(f"skipped  {line}")
    print(f"test cases: {passed} passed, {failed} failed, {len(skipped)} skipped")


if __name__ == "__main__":
    main()
