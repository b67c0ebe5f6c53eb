"""What an operator waits for: see `run`, which starts this.

All times are when a message arrived in this process, on its monotonic clock; nodes get theirs within milliseconds.
The parts of a latency:
  end of sweep   last frame -> volume. us_ingest finds that the sweep has ended (at once where the frames announce its
                 length, as here; else after its parameter sweep_pause), puts it together and sends it.
  registration   what the result says of its stages.
  hand-over      the rest until the result: the volume's conversion, the wait for tf, threads. Tf must reach the
                 volume's stamp before the registration begins, and `jump_window` beyond it before it ends.
  publishing     result -> tf. Less than a few milliseconds, or below 0, is 0: messages overtake each other here.
"""
import argparse
import csv
import json
import os
import pathlib
import re
import signal
import statistics
import sys
import tempfile
import threading
import time

import numpy
import rosbag
import rospy
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(PROJECT / "test/ros"), str(PROJECT / "scripts")]
import test_replay  # noqa: E402: the path comes first
from demo_client import matrix_of, quaternion_of  # noqa: E402
from node_under_test import PACKAGE  # noqa: E402
from us_ct_registration.msg import CtInfo, PreScanFrame, PreScanVolume, RegistrationResult, StatusCode  # noqa: E402
from us_ct_registration.srv import Register, SetInitialAlignment, SetInitialAlignmentRequest  # noqa: E402

FIXED_FRAME = "patient"
CT_SIZE = (512, 512, 300)
START_S = 1000.0
PAUSE_S = 3.0  # between sweeps: the least that `usct bag write` takes
LIMIT_S = 30.0
PRESETS = ("phantom", "fast", "patient")
CONTINUOUS, REQUEST = "continuous", "/register"
# Parts of a latency, in their order; they add up to it.
PARTS = ("end of sweep", "registration", "hand-over", "publishing")
# Of /proc/PID/status: the most so far, now, and what of it is no file (libraries count in each process).
MEMORY = ("VmHWM", "VmRSS", "RssAnon")
MM_PER_M = 1000.0


class Phantom:
    """A patient whose CT is as large as those of hospitals, ultrasound, and where the CT truly is."""

    def __init__(self, folder):
        case = folder / "case"
        self._usct("phantom", "--scene", "patient", "--seed", "1", "--quiet", "--output", case)
        self.us = case / "us.nrrd"
        self.ct = folder / "ct.nrrd"
        enlarge(case / "ct.nrrd", self.ct)
        self.pose = folder / "pose.tfm"
        self.pose.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                             f"Parameters: {test_replay.POSES[0]}\nFixedParameters: 0 0 0 0\n")
        self.T_us_ct = self._transform(case / "truth.tfm")
        self.T_fixed_us = numpy.linalg.inv(self._transform(self.pose))
        with open(case / "targets_ct.csv") as stream:
            self.targets_ct = numpy.array([[float(row[axis]) for axis in "xyz"] for row in csv.DictReader(stream)])

    @staticmethod
    def _usct(*arguments):
        return test_replay.run([test_replay.usct(), *map(str, arguments)], None)

    def _transform(self, path):
        """US from CT; in the file of a fixed pose, the fixed frame is in the CT's place. mm."""
        return numpy.array(json.loads(self._usct("info", "--json", path))["T_us_ct"])

    def bag(self, path, sweeps, frame_rate):
        """The same sweep again and again, with tf of a robot that comes and goes."""
        self._usct("bag", "write", *["--us", self.us] * sweeps, "--fixed-pose", self.pose, "--start", START_S,
                   "--frame-rate", frame_rate, "--pause", PAUSE_S, "--output", path)
        return path

    def start(self, number):
        """Fixed frame from CT, some 10 mm off, each number in another direction."""
        random = numpy.random.default_rng(number)
        axis, way = (vector / numpy.linalg.norm(vector) for vector in random.normal(size=(2, 3)))
        centre = self.targets_ct.mean(axis=0)
        motion = numpy.eye(4)
        motion[:3, :3] = rotation(axis, numpy.radians(5.0))
        motion[:3, 3] = centre - motion[:3, :3] @ centre + 9.5 * way
        return self.T_fixed_us @ self.T_us_ct @ motion

    def error_mm(self, T_us_ct):
        """Mean over the kidney's surface."""
        apart = T_us_ct - self.T_us_ct
        return float(numpy.linalg.norm(self.targets_ct @ apart[:3, :3].T + apart[:3, 3], axis=1).mean())


def rotation(axis, angle_rad):
    x, y, z = axis
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return numpy.eye(3) + numpy.sin(angle_rad) * cross + (1 - numpy.cos(angle_rad)) * cross @ cross


def enlarge(small, large):
    """The CT in the middle of one of CT_SIZE; its outermost voxels go on. NRRD, not compressed."""
    header, voxels = small.read_bytes().split(b"\n\n", 1)
    header = header.decode()
    number = r"[-+.\deE]+"
    size = numpy.array(re.search(r"^sizes: (.*)$", header, re.M).group(1).split(), int)
    steps = re.search(r"^space directions: (.*)$", header, re.M).group(1)
    origin = re.search(r"^space origin: (.*)$", header, re.M).group(1)
    before = (numpy.array(CT_SIZE) - size) // 2
    first = numpy.array(re.findall(number, origin), float) - \
        before @ numpy.array(re.findall(number, steps), float).reshape(3, 3)
    header = header.replace("sizes: " + " ".join(map(str, size)), "sizes: " + " ".join(map(str, CT_SIZE)))
    header = header.replace(origin, "(" + ",".join(repr(float(x)) for x in first) + ")")
    margins = [(b, n - s - b) for b, n, s in zip(before, CT_SIZE, size)][::-1]
    ct = numpy.pad(numpy.frombuffer(voxels, "<i2").reshape(size[::-1]), margins, mode="edge")
    large.write_bytes(header.encode() + b"\n\n" + ct.tobytes())


def without_announced_end(bag, path):
    """The same bag from a sender that does not know how many frames a sweep will have."""
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(path), "w") as target:
        for topic, message, stamp, header in source.read_messages(return_connection_header=True):
            if topic == "/us/frames":
                message.frames_in_sweep = 0
            target.write(topic, message, stamp, connection_header=header)
    return path


class Live(test_replay.System):
    """The user's launch file with a master of its own."""

    def __init__(self, folder, jump_window_s=None):
        super().__init__(folder, None)
        self.jump_window_s = jump_window_s

    def start_nodes(self, ct, preset, nodelet, continuous):
        parameters = [f"continuous: {str(continuous).lower()}"]
        if self.jump_window_s is not None:
            parameters.append(f"jump_window: {self.jump_window_s}")
        override = self.folder / "override.yaml"
        override.write_text(f"registration: {{{', '.join(parameters)}}}\n")
        self.start("nodes", "roslaunch", PACKAGE, "registration.launch", f"fixed_frame:={FIXED_FRAME}", "policy:=auto",
                   f"ct:={ct}", f"preset:={preset}", f"nodelet:={nodelet}", f"override:={override}")

    def processes(self):
        """Process numbers and names of all that uses this master, but for this process."""
        master = f"ROS_MASTER_URI={self.environment['ROS_MASTER_URI']}".encode()
        found = {}
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                arguments = (process / "cmdline").read_bytes().decode().split("\0")
                if master not in (process / "environ").read_bytes().split(b"\0") or int(process.name) == os.getpid():
                    continue
            except OSError:
                continue
            found[int(process.name)] = self._name(arguments)
        return found

    @staticmethod
    def _name(arguments):
        node = [argument[len("__name:="):] for argument in arguments if argument.startswith("__name:=")]
        if node:
            return f"nodelet load {node[0]}" if "load" in arguments else node[0]
        if "rosmaster" in " ".join(arguments):
            return "rosmaster"
        if "roslaunch" in " ".join(arguments):
            return "roslaunch"
        return "rosbag"

    def memory_mib(self):
        """MEMORY by process; processes of one name together."""
        sums = {}
        for pid, name in self.processes().items():
            try:
                status = pathlib.Path(f"/proc/{pid}/status").read_text()
            except OSError:
                continue
            kib = [int(re.search(rf"^{key}:\s+(\d+) kB", status, re.M).group(1)) for key in MEMORY]
            before = sums.get(name, (0.0,) * len(MEMORY))
            sums[name] = tuple(b + k / 1024.0 for b, k in zip(before, kib))
        return sums

    def end(self):
        try:
            self.stop_all()
        finally:
            for pid in self.processes():
                os.kill(pid, signal.SIGKILL)


class Watcher:
    """When which message arrived here. Volumes and results are known by the stamp of their ultrasound."""

    def __init__(self):
        self._changed = threading.Condition()
        self.forget()
        for topic, kind, take in (("/us/frames", PreScanFrame, self._frame),
                                  ("/us/volume", PreScanVolume, self._volume),
                                  ("/registration/result", RegistrationResult, self._result),
                                  ("/tf", TFMessage, self._tf), ("/ct/info", CtInfo, self._ct)):
            rospy.Subscriber(topic, kind, take, tcp_nodelay=True, buff_size=2**22)

    def forget(self):
        with self._changed:
            self.has_ct = False
            self.volume = None
            self.refusals = []   # for want of inputs: they name no ultrasound
            self.frames, self.volumes, self.results = {}, {}, {}
            self.ct_in_tf = {}   # transform: when it was first seen

    def _note(self, action):
        now = time.monotonic()
        with self._changed:
            action(now)
            self._changed.notify_all()

    def _frame(self, frame):
        self._note(lambda now: self.frames.setdefault(frame.header.stamp, now))

    def _volume(self, volume):
        def note(now):
            self.volume = volume
            self.volumes.setdefault(volume.header.stamp, now)
        self._note(note)

    def _result(self, result):
        def note(now):
            if result.us_stamp:
                self.results.setdefault(result.us_stamp, (now, result))
            else:
                self.refusals.append((now, result))
        self._note(note)

    def _tf(self, message):
        def note(now):
            for stamped in message.transforms:
                if stamped.child_frame_id == "ct":
                    self.ct_in_tf.setdefault(numbers_of(stamped.transform), now)
        self._note(note)

    def _ct(self, _):
        def note(_):
            self.has_ct = True
        self._note(note)

    def wait(self, condition, what):
        with self._changed:
            value = self._changed.wait_for(condition, LIMIT_S)
        if not value:
            raise AssertionError(f"waited {LIMIT_S:.0f} s for {what}")
        return value

    def refusal_after(self, stamp):
        return next((refusal for refusal in self.refusals if refusal[0] > self.volumes[stamp]), None)


def numbers_of(transform):
    t, q = transform.translation, transform.rotation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def message_of(T_mm):
    return Transform(Vector3(*T_mm[:3, 3] / MM_PER_M), quaternion_of(T_mm[:3, :3]))


def is_registered(result):
    return result.status.code == StatusCode.REGISTERED


def durations_of(result):
    return {measure.name: measure.value for measure in result.durations if measure.name != "total"}


def wait_until_ready(watcher, register):
    """The registration has the CT: what it then lacks is ultrasound."""
    watcher.wait(lambda: watcher.has_ct, "the CT")
    register.wait_for_service(LIMIT_S)
    end = time.monotonic() + LIMIT_S
    while register().result.status.code != StatusCode.NO_ULTRASOUND:
        if time.monotonic() > end:
            raise AssertionError("the registration does not get the CT")
        time.sleep(0.2)


def set_start(T_fixed_ct):
    request = SetInitialAlignmentRequest(type=SetInitialAlignmentRequest.POSE, transform=message_of(T_fixed_ct))
    request.header.frame_id = FIXED_FRAME
    status = rospy.ServiceProxy("/registration/set_initial_alignment", SetInitialAlignment)(request).status
    if status.code != StatusCode.OK:
        raise AssertionError(f"the start was refused: {status.message}")


def request(register, stamp):
    """Whoever is faster than the registration's own copy of the volume is answered for the one before."""
    calls = 1
    while is_before(register().result, stamp) and calls < 100:
        calls += 1
    if calls > 1:
        print(f"/register took older ultrasound at first, {calls} calls", file=sys.stderr)
    return calls


def is_before(result, stamp):
    return result.status.code == StatusCode.NO_ULTRASOUND or is_registered(result) and result.us_stamp < stamp


def repetition(watcher, register, phantom, trigger, number):
    """From a start that is off, the next sweep."""
    known = set(watcher.volumes)
    set_start(phantom.start(number))
    stamp = watcher.wait(lambda: next(iter(set(watcher.volumes) - known), None), "a volume")
    calls = request(register, stamp) if trigger == REQUEST else 0
    arrived, result = watcher.wait(lambda: watcher.results.get(stamp) or watcher.refusal_after(stamp), "a result")
    record = {"status": result.status.message, "start": result.initial_alignment, "calls": calls}
    if not is_registered(result):
        print(f"not registered: {result.status.message}", file=sys.stderr)
        return record
    in_tf = watcher.wait(lambda: watcher.ct_in_tf.get(numbers_of(result.fixed_transform)), "the CT in tf")
    durations = durations_of(result)
    announced = watcher.volumes[stamp]
    registration = sum(durations.values())
    parts = (announced - watcher.frames[stamp], registration, arrived - announced - registration, in_tf - arrived)
    record.update(zip(PARTS, parts), latency=in_tf - watcher.frames[stamp], durations=durations,
                  error_mm=phantom.error_mm(matrix_of(result.transform)))
    return record


def attempted(action, *arguments):
    """One that fails, as where too much else runs, is counted and does not end the others."""
    try:
        return action(*arguments)
    except AssertionError as error:
        print(error, file=sys.stderr)
        return {"status": str(error)}


class Stream:
    """Volumes in quick succession, of a probe that sways with the patient's breath; tf of that probe."""

    TF_HZ = 50.0
    SWAY_MM, SWAY_S = 5.0, 4.0

    def __init__(self, phantom, volume, rate_hz):
        self._phantom, self._volume, self._rate_hz = phantom, volume, rate_hz
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        self._volumes = rospy.Publisher("/us/volume", PreScanVolume, queue_size=2, tcp_nodelay=True)
        self._ended = threading.Event()
        self._stamp = rospy.Time()

    def _send_tf(self, stamp):
        T = self._phantom.T_fixed_us.copy()
        T[0, 3] += self.SWAY_MM * numpy.sin(2 * numpy.pi * stamp.to_sec() / self.SWAY_S)
        stamped = TransformStamped(child_frame_id="us", transform=message_of(T))
        stamped.header.stamp, stamped.header.frame_id = stamp, FIXED_FRAME
        self._tf.publish(TFMessage([stamped]))

    def _keep_sending_tf(self):
        while not self._ended.wait(1.0 / self.TF_HZ):
            now = rospy.Time.now()
            if now > self._stamp:
                self._stamp = now
                self._send_tf(now)

    def send(self, seconds):
        """Returns when which stamp was sent. Waits for tf and for the nodes to hear of the publishers."""
        sender = threading.Thread(target=self._keep_sending_tf)
        sender.start()
        sent = {}
        try:
            time.sleep(1.0)
            begin = time.monotonic()
            while time.monotonic() < begin + seconds:
                self._volume.header.stamp = rospy.Time.now()
                # The images show the kidney as from one place, whatever the probe did before.
                self._volume.frame_stamps = [self._volume.header.stamp] * self._volume.frames
                sent[self._volume.header.stamp] = time.monotonic()
                self._volumes.publish(self._volume)
                time.sleep(max(0.0, begin + len(sent) / self._rate_hz - time.monotonic()))
            time.sleep(1.0)
        finally:
            self._ended.set()
            sender.join()
            self._tf.unregister()
            self._volumes.unregister()
        return sent


def measure_rate(watcher, phantom, options):
    # Until then the bag has a robot in tf that takes the probe away.
    time.sleep(max(0.0, max(watcher.frames.values()) + PAUSE_S + 0.5 - time.monotonic()))
    watcher.refusals.clear()
    sent = Stream(phantom, watcher.volume, options.offered_hz).send(options.seconds)
    results = [(when, result) for stamp, (when, result) in watcher.results.items() if stamp in sent]
    registered = [(when, result) for when, result in results if is_registered(result)]
    refused = [result.status.message for _, result in results + watcher.refusals if not is_registered(result)]
    for reason in refused[:3]:
        print(f"refused: {reason}", file=sys.stderr)
    rate = {"offered_hz": len(sent) / options.seconds, "registered_hz": 0.0, "refused": len(refused),
            "reasons": refused}
    ages = [watcher.ct_in_tf[numbers_of(result.fixed_transform)] - sent[result.us_stamp] for _, result in registered
            if numbers_of(result.fixed_transform) in watcher.ct_in_tf]
    if len(registered) < 2 or not ages:
        return rate
    times = [when for when, _ in registered]
    rate["registered_hz"] = (len(registered) - 1) / (max(times) - min(times))
    rate["age_s"] = statistics.median(ages)
    durations = [durations_of(result) for _, result in registered]
    rate["durations"] = {name: statistics.median(one.get(name, 0.0) for one in durations) for name in durations[0]}
    rate["error_mm"] = max(phantom.error_mm(matrix_of(result.transform)) for _, result in registered)
    return rate


def measure_launch(live, watcher, phantom, bag, case, options):
    """One launch: repetitions, memory, and in continuous mode the rate."""
    watcher.forget()
    register = rospy.ServiceProxy("/register", Register, persistent=False)
    live.start_nodes(phantom.ct, case["preset"], case["nodelet"], case["trigger"] == CONTINUOUS)
    try:
        wait_until_ready(watcher, register)
        live.play_bag(bag, "--keep-alive")
        measured = dict(case, repetitions=[attempted(repetition, watcher, register, phantom, case["trigger"], number)
                                           for number in range(options.repetitions)])
        measured["memory_mib"] = live.memory_mib()
        if case["trigger"] == CONTINUOUS and case["announced_end"]:
            measured["rate"] = measure_rate(watcher, phantom, options)
    finally:
        live.stop("player")
        live.stop("nodes")
    return measured


def cases_of(options):
    for nodelet in options.nodelet:
        for preset in options.presets:
            for trigger in (CONTINUOUS, REQUEST):
                yield {"nodelet": nodelet, "preset": preset, "trigger": trigger, "announced_end": True}
    # How long the end of a sweep takes where only a pause tells.
    yield {"nodelet": options.nodelet[-1], "preset": options.presets[0], "trigger": CONTINUOUS, "announced_end": False}


def measure(folder, live, options):
    phantom = Phantom(folder)
    bag = phantom.bag(folder / "sweeps.bag", options.repetitions, options.frame_rate)
    bags = {True: bag, False: without_announced_end(bag, folder / "no_end.bag")}
    live.start_master()
    os.environ.update(live.environment)
    rospy.init_node("measure", disable_signals=True)
    watcher = Watcher()
    launches = []
    for case in cases_of(options):
        print(", ".join(f"{key} {value}" for key, value in case.items()), file=sys.stderr)
        launches.append(measure_launch(live, watcher, phantom, bags[case["announced_end"]], case, options))
    return launches


def table(heads, rows):
    for row in (heads, ["---"] * len(heads), *rows):
        print("| " + " | ".join(row) + " |")
    print()


def latency_row(launch):
    good = [one for one in launch["repetitions"] if "latency" in one]
    row = [launch["trigger"] + ("" if launch["announced_end"] else ", length of the sweep unknown"), launch["nodelet"],
           launch["preset"], f"{len(good)} of {len(launch['repetitions'])}"]
    if not good:
        return row + ["-"] * (len(PARTS) + 3)
    medians = [f"{statistics.median(one[key] for one in good):.3f}" for key in ("latency", *PARTS)]
    return [*row, medians[0], f"{max(one['latency'] for one in good):.3f}", *medians[1:],
            f"{max(one['error_mm'] for one in good):.2f}"]


def rate_row(launch):
    rate = launch["rate"]
    return [launch["nodelet"], launch["preset"], f"{rate['offered_hz']:.1f}", f"{rate['registered_hz']:.2f}",
            str(rate["refused"]), f"{rate.get('age_s', float('nan')):.3f}", f"{rate.get('error_mm', float('nan')):.2f}"]


def memory_rows(launches, nodelet):
    """The launch that took most, by process."""
    most = {}
    for launch in launches:
        if launch["nodelet"] == nodelet:
            for name, sizes in launch["memory_mib"].items():
                most[name] = tuple(map(max, sizes, most.get(name, sizes)))
    others = ("rosmaster", "roslaunch", "rosbag", "player")
    names = sorted(most, key=lambda name: (name in others, name))
    return [[nodelet, name, "theirs" if name in others else "ours", *(f"{size:.0f}" for size in most[name])]
            for name in names]


def print_tables(launches, options):
    print("Last frame of a sweep to the CT in tf, s; the parts are medians\n")
    table(["trigger", "nodelet", "preset", "registered", "median", "worst", *PARTS, "worst error, mm"],
          map(latency_row, launches))
    print("Continuous mode, volumes in quick succession; age: from a volume to its CT in tf, median\n")
    table(["nodelet", "preset", "offered, Hz", "registered, Hz", "refused", "age, s", "worst error, mm"],
          [rate_row(launch) for launch in launches if "rate" in launch])
    print("Memory, MiB, of the launch that took most\n")
    table(["nodelet", "process", "", "peak", "at the end", "without files"],
          [row for nodelet in options.nodelet for row in memory_rows(launches, nodelet)])


def parse_arguments():
    parser = argparse.ArgumentParser(prog="bench/live/run", formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=5, help="sweeps per launch")
    parser.add_argument("--presets", nargs="+", default=list(PRESETS), help="of the registration")
    parser.add_argument("--nodelet", nargs="+", choices=("false", "true"), default=["false", "true"],
                        help="nodes as processes, and all in one")
    parser.add_argument("--frame-rate", type=float, default=80.0, help="of the scanner, frames per s")
    parser.add_argument("--offered-hz", type=float, default=10.0, help="volumes per s in the measurement of the rate")
    parser.add_argument("--seconds", type=float, default=5.0, help="length of that measurement")
    parser.add_argument("--jump-window", type=float, help="s, in place of the registration's configuration")
    parser.add_argument("--output", type=pathlib.Path, help="JSON with every number")
    return parser.parse_args()


def main():
    options = parse_arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    load, begin = os.getloadavg()[0], time.monotonic()
    with tempfile.TemporaryDirectory(prefix="usct_live_") as folder:
        live = Live(pathlib.Path(folder), options.jump_window)
        try:
            launches = measure(pathlib.Path(folder), live, options)
        except BaseException:
            print(live.log(), file=sys.stderr)
            raise
        finally:
            live.end()
    conditions = {"processors": len(os.sched_getaffinity(0)), "load_before": load, "load_after": os.getloadavg()[0],
                  "took_s": time.monotonic() - begin}
    if options.output:
        options.output.write_text(json.dumps(dict(conditions, launches=launches), indent=1) + "\n")
    print_tables(launches, options)
    print(", ".join(f"{key} {value:.3g}" for key, value in conditions.items()))


if __name__ == "__main__":
    main()
