"""A phantom patient with the video of a synthetic endoscope, and the error of the overlay on it."""
import json
import subprocess
import sys

import test_replay

OVERLAY_ERROR = [sys.executable, str(test_replay.PROJECT / "scripts/overlay_error.py")]
LABELS = """
1: {name: kidney, colour: [0.80, 0.45, 0.35]}
2: {name: tumour, colour: [0.35, 0.85, 0.40]}
3: {name: artery, colour: [0.90, 0.15, 0.15]}
4: {name: vein, colour: [0.25, 0.40, 0.95]}
"""


class OverlayCase(test_replay.Acquisition):
    """`phantom`: options of usct phantom besides the scene."""

    def __init__(self, folder, *phantom, shift_mm=5.0):
        folder.mkdir(exist_ok=True)
        super().__init__(folder, ("--scene", "patient", "--endoscope", *phantom), shift_mm)
        test_replay.run([*test_replay.CLIENT, "segment", str(self.case)], None)
        # The video comes later than anybody can need for the registration; the replay jumps to it.
        self.bag_options += ("--endoscope", self.case / "endoscope", "--endoscope-delay", "900")
        (folder / "labels.yaml").write_text(LABELS)
        self.override = folder / "override.yaml"
        self.override.write_text(f"ct_server: {{label_table: {folder / 'labels.yaml'}}}\n")

    def launch_arguments(self):
        return ("preset:=patient", f"ct_labels:={self.case / 'segmentation.nrrd'}", f"override:={self.override}")


def start(system):
    """The nodes, and beside them the overlay that is measured."""
    system.start_master()
    system.start_nodes(*system.acquisition.launch_arguments())
    system.client("ready")
    # Not before: of two launches at once, one would not find the run id of the other.
    system.start("overlay", "roslaunch", test_replay.PACKAGE, "overlay_error.launch")


def register(system):
    """Replays the sweep and registers it; the answer of the service."""
    system.play(0)
    system.client("initial", system.acquisition.initial)
    return test_replay.run(["rosservice", "call", "/register"], system.environment)


def measure(system, *options):
    """Replays the video: the measures of scripts/overlay_error.py, with its options."""
    folder, case = system.folder, system.acquisition.case
    system.client("result", folder / "result.json")
    system.stop("player")
    bag = str(system.acquisition.folder / f"{system.acquisition.start_s}.bag")
    measuring = subprocess.Popen([*OVERLAY_ERROR, "measure", str(case), str(folder / "result.json"), "--output",
                                  str(folder / "measures.json"), *map(str, options)], env=system.environment, text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    system.start("player", *OVERLAY_ERROR, "play", bag, "--keep-alive", "--listener", "/overlay_error_")
    printed, _ = measuring.communicate(timeout=test_replay.LIMIT_S)
    if measuring.returncode != 0:
        raise AssertionError(printed)
    print(printed)
    return json.loads((folder / "measures.json").read_text())


def stop(system):
    system.stop("overlay")
    system.stop_all()
