#!/usr/bin/env python3
"""Endurance of the running system: see README.md."""
import argparse
import json
import multiprocessing
import os
import pathlib
import random as random_module
import re
import shutil
import signal
import sys
import threading
import time

import numpy
import rosbag

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(PROJECT / place) for place in ("bench/soak", "bench/live", "test/ros", "scripts")]
import ledger  # noqa: E402: the path comes first
import measure  # noqa: E402
import memory  # noqa: E402
import session  # noqa: E402
import test_replay  # noqa: E402
from node_under_test import PACKAGE  # noqa: E402

SEEDS = (3, 4)
SIZE = ("120", "64", "41")
START_S = 90.0           # within which the nodes must be up
KILL_EVERY_S = 15.0
SAMPLE_S = 2.0
PEAK_MIB = 1500.0        # of any process, which no CT and sweep of this size explains


def usct(*arguments):
    return test_replay.run([test_replay.usct(), *map(str, arguments)], None)


def transform(path):
    return numpy.array(json.loads(usct("info", "--json", path))["T_us_ct"])


def make_anatomy(data, seed):
    """A phantom below the data root, and the frames of its sweep."""
    name = f"agar{seed}"
    case = data / name
    usct("phantom", "--scene", "agar", "--seed", seed, "--size", *SIZE, "--quiet", "--output", case)
    targets = numpy.loadtxt(case / "targets_ct.csv", delimiter=",", skiprows=1)
    bag = case / "sweep.bag"
    usct("bag", "write", "--us", case / "us.nrrd", "--ct", case / "ct.nrrd", "--output", bag)
    with rosbag.Bag(str(bag)) as recorded:
        frames = [message for _, message, _ in recorded.read_messages(topics=["/us/frames"])]
        (ct_crc32,) = (message.crc32 for _, message, _ in recorded.read_messages(topics=["/ct/volume"]))
    anatomy = ledger.Anatomy(name, transform(case / "truth.tfm"), ct_crc32, targets)
    # The messages of a bag are of classes that rosbag has made.
    return anatomy, [session.mutations.raw_frame(frame) for frame in frames]


class Soak(measure.Live):
    """The system with a master of its own, on the wall clock."""

    def __init__(self, folder):
        super().__init__(folder)
        self.data = folder / "data"
        self.alignment_file = folder / "alignment.json"

    def start_all(self, plan):
        self.start_master()
        test_replay.run(["rosparam", "set", "use_sim_time", "false"], self.environment)
        override = self.folder / "override.yaml"
        override.write_text("registration: {continuous: true, threads: 1}\n")
        self.start("nodes", "roslaunch", PACKAGE, "registration.launch", f"fixed_frame:={session.FIXED}", "policy:=auto",
                   f"ct:={plan['ct']}/ct.nrrd", f"data_root:={self.data}", "preset:=phantom", "respawn:=true",
                   f"restore:={plan['restore']}", f"alignment_file:={self.alignment_file}", f"override:={override}",
                   f"nodelet:={str(plan['nodelet']).lower()}")

    def end_all(self, how):
        """A power cut ends all at once; else the master dies first, as when roscore crashes."""
        if how == "power cut":
            for pid in self.processes():
                os.kill(pid, signal.SIGKILL)
            for process in self.running.values():
                process.wait(60)
            self.running.clear()
            return
        self.stop("master", signal.SIGKILL)
        self.stop("nodes")
        self.end()


class Runner:
    def __init__(self, folder, options):
        self.folder, self.options = folder, options
        self.random = random_module.Random(options.seed)
        self.soak = Soak(folder)
        self.soak.data.mkdir(parents=True)
        made = [make_anatomy(self.soak.data, seed) for seed in SEEDS]
        self.anatomies, self.frames = [one for one, _ in made], {one.name: frames for one, frames in made}
        ct = (self.soak.data / self.anatomies[0].name / "ct.nrrd").read_bytes()
        (self.soak.data / "damaged.nrrd").write_bytes(ct[:len(ct) // 2])
        pose = folder / "pose.tfm"
        pose.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                        f"Parameters: {test_replay.POSES[0]}\nFixedParameters: 0 0 0 0\n")
        self.T_fixed_us = numpy.linalg.inv(transform(pose))
        self.records, self.sweeps, self.last_accepted = [], [], None
        self.lives, self.faults = memory.Lives(), ledger.Faults()
        self.ends = {}

    def plan(self, number, seconds):
        kept = (session.read_file(self.soak.alignment_file) or {}).get("alignment") or {}
        held = next((one for one in self.anatomies if one.ct_crc32 == kept.get("ct_crc32")), None)
        ct = held if held is not None and self.random.random() < 0.8 else self.random.choice(self.anatomies)
        nodelet = {"true": True, "false": False, "both": number // 2 % 2 == 1}[self.options.nodelet]
        manager = ["us_ct_manager"] if nodelet else []
        return {"seed": self.random.randrange(2**31), "seconds": seconds, "nodelet": nodelet,
                "calm": number % 2 == 0, "kill_every_s": KILL_EVERY_S, "nodes": [*test_replay.NODES, *manager],
                "restore": self.random.choice(("same_ct", "confirm")), "ct": ct.name, "ct_crc32": ct.ct_crc32,
                "alignment_file": str(self.soak.alignment_file), "is_first": number == 0, "inject": self.options.inject,
                "sweeps": self.sweeps[-200:], "last_accepted": self.last_accepted, "T_fixed_us": self.T_fixed_us.tolist()}

    def sample(self, ended):
        while not ended.wait(SAMPLE_S):
            self.lives.sample(time.monotonic(), self.soak.processes())

    def run_session(self, number, seconds):
        plan = self.plan(number, seconds)
        print(f"session {number}: {'calm' if plan['calm'] else 'with kills'}, "
              f"{'nodelets' if plan['nodelet'] else 'processes'}, {plan['restore']}, {plan['ct']}", file=sys.stderr)
        self.soak.start_all(plan)
        os.environ.update(self.soak.environment)
        path = self.folder / "record.json"
        path.unlink(missing_ok=True)
        ended = threading.Event()
        child = multiprocessing.get_context("fork").Process(
            target=session.run, args=(plan, self.anatomies, self.frames, path))
        child.start()
        sampler = threading.Thread(target=self.sample, args=(ended,))
        sampler.start()
        child.join(seconds + 4 * START_S)
        ended.set()
        sampler.join()
        if child.is_alive():
            child.kill()
            child.join()
        self.finish_session(path)

    def finish_session(self, path):
        how = self.random.choice(("master killed", "power cut"))
        self.ends[how] = self.ends.get(how, 0) + 1
        self.soak.end_all(how)
        for text in re.findall(r"^.*(?:exit code -(?:6|11|8|7)|terminate called).*$",
                               (self.folder / "nodes.log").read_text(errors="replace"), re.M):
            self.faults.add("a crash", text.strip())
        with open(self.folder / "all_nodes.log", "ab") as log:
            log.write((self.folder / "nodes.log").read_bytes())
        (self.folder / "nodes.log").write_bytes(b"")
        if not path.exists():
            self.faults.add("a session without a record", "it hung or failed; its log has more")
            return
        record = json.loads(path.read_text())
        self.records.append(record)
        self.sweeps += record["sweeps"]
        self.last_accepted = record["last_accepted"]
        for kind, count in record["faults"].items():
            for _ in range(count):
                self.faults.add(kind, record["first"][kind])
        after = ledger.Ledger(self.anatomies)
        after.last_accepted = self.last_accepted
        after.file(session.read_file(self.soak.alignment_file), f"after the end ({how})")
        for kind, details in after.faults.first.items():
            self.faults.add(kind, details)

    def run(self):
        end = time.monotonic() + 60.0 * self.options.minutes
        number = 0
        while (left := end - time.monotonic()) > 20.0:
            self.run_session(number, min(left, 60.0 * self.options.session_minutes))
            number += 1

    def last_kill(self, when):
        """The faults that were injected into nodes in the 20 s before."""
        return [what for record in self.records for moment, what in record["kills"] if when - 20.0 < moment <= when + 1.0]

    def summary(self):
        counts = {}
        for record in self.records:
            for what, count in record["counts"].items():
                counts[what] = counts.get(what, 0) + count
        gaps = sorted((length, begin) for record in self.records for begin, length in record["gaps"])
        growths = list(self.lives.growths())
        for (name, _), samples in self.lives.samples.items():
            peak = max(mib for _, mib in samples)
            if peak > PEAK_MIB:
                self.faults.add("memory", f"{name}: {peak:.0f} MiB at its peak")
        for name, length, _, _, slope, growth in growths:
            if growth > self.options.memory_limit_mib:
                self.faults.add("memory", f"{name}: {growth:.1f} MiB in {length:.0f} s, {slope:.0f} MiB per hour")
        return {"sessions": len(self.records), "ends": self.ends, "counts": dict(sorted(counts.items())),
                "look_ups": sum(record["look_ups"] for record in self.records),
                "without_transform": sum(record["without_transform"] for record in self.records),
                "worst_mm": max((record["worst_mm"] for record in self.records), default=0.0),
                "gaps": [{"s": length, "after": self.last_kill(begin)} for length, begin in gaps],
                "memory": growths, "samples": [[name, memory.thin(samples)] for (name, _), samples in
                                               self.lives.samples.items()], "faults": self.faults.counts, "first": self.faults.first}


def print_summary(summary):
    print(f"sessions {summary['sessions']}, ended by {summary['ends']}")
    print(", ".join(f"{what} {count}" for what, count in summary["counts"].items()))
    print(f"look-ups {summary['look_ups']}, without a transform {summary['without_transform']}; "
          f"worst accepted error {summary['worst_mm']:.2f} mm")
    print("without a transform although an alignment was in force, s: " + ", ".join(
        f"{gap['s']:.1f} ({'; '.join(gap['after']) or 'no node was killed'})" for gap in summary["gaps"]))
    print("\n| process | s | median, MiB | peak, MiB | slope, MiB/h | growth, MiB |\n|---|---|---|---|---|---|")
    for name, length, median, peak, slope, growth in summary["memory"]:
        print(f"| {name} | {length:.0f} | {median:.1f} | {peak:.1f} | {slope:.1f} | {growth:.1f} |")
    for kind, count in summary["faults"].items():
        print(f"\nFAULT {kind}, {count} times; the first: {summary['first'][kind]}")


def parse_arguments():
    parser = argparse.ArgumentParser(prog="bench/soak/run", formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("minutes", type=float, help="length")
    parser.add_argument("--seed", type=int, default=1, help="of all that is drawn; times are those of the machine")
    parser.add_argument("--nodelet", choices=("true", "false", "both"), default="both", help="nodes as nodelets, or both in turn")
    parser.add_argument("--session-minutes", type=float, default=10.0, help="from a start of the master to its end")
    parser.add_argument("--memory-limit-mib", type=float, default=32.0, help="growth of a process that counts as a fault")
    parser.add_argument("--output", type=pathlib.Path, default=PROJECT / "soak_out", help="folder for logs and the summary")
    parser.add_argument("--inject", action="store_true", help="publish wrong transforms, which the watcher must report")
    return parser.parse_args()


def main():
    options = parse_arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    shutil.rmtree(options.output, ignore_errors=True)
    options.output.mkdir(parents=True)
    runner = Runner(options.output.resolve(), options)
    try:
        runner.run()
    finally:
        runner.soak.end()
        summary = runner.summary()
        (options.output / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
        print_summary(summary)
    sys.exit(1 if summary["faults"] or not runner.records else 0)


if __name__ == "__main__":
    main()
