#!/usr/bin/env python3
"""Counts the test cases below a folder of JUnit XML files and lists the skipped and the failed ones with reasons."""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def reason(outcome):
    """Why a test case was skipped or has failed, in one line: its message, or the type and first line of its text."""
    if outcome is None:
        return ""
    text = outcome.get("message") or f"{outcome.get('type')}: {(outcome.text or '').strip().partition(chr(10))[0]}"
    return " ".join(text.split())


def main():
    passed = 0
    skipped, failed = [], []
    for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.xml")):
        try:
            cases = ElementTree.parse(path).iter("testcase")
        except ElementTree.ParseError as error:
            # A test program that was ended at its time limit leaves half a file, or an empty one.
            failed.append(f"{path.name}: cannot be read: {error}")
            continue
        for case in cases:
            name = f"{case.get('classname')}.{case.get('name')}"
            skip = case.find("skipped")
            wrong = [outcome for outcome in case if outcome.tag in ("failure", "error")]
            if skip is not None or case.get("result") == "skipped":
                skipped.append(f"{name}: {reason(skip)}")
            elif wrong:
                failed.append(f"{name}: {reason(wrong[0])}")
            else:
                passed += 1
    for line in skipped:
        print(f"skipped  {line}")
    for line in failed:
        print(f"failed   {line}")
    print(f"test cases: {passed} passed, {len(failed)} failed, {len(skipped)} skipped")


if __name__ == "__main__":
    main()
