"""The operating room between a start of the master and its end: a robot, a scanner, an operator, an intruder who damages
messages and kills nodes, and the watcher. Runs in a process of its own, since a ROS 1 node does not find a new master."""
import json
import os
import random as random_module
import signal
import threading
import time

import numpy
import rospy
import tf2_ros
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage
from us_ct_registration.msg import Alignment, CtInfo, CtVolume, PreScanVolume, RegistrationResult, StatusCode
from us_ct_registration.srv import (Decide, DecideRequest, LoadCt, SetCtRoi, SetInitialAlignment, SetInitialAlignmentRequest)

import mutations
from demo_client import matrix_of, quaternion_of
from ledger import Ledger, Sweep

FIXED, US, CT = "patient", "us", "ct"
TF_HZ, LOOK_UP_HZ, FRAME_HZ = 50.0, 50.0, 80.0
MM_PER_M = 1000.0
# Between a motion of the probe and a sweep: longer than the window in which a motion counts as a jump.
REST_S = 0.35


def message_of(T_mm):
    return Transform(Vector3(*T_mm[:3, 3] / MM_PER_M), quaternion_of(T_mm[:3, :3]))


def small_motion(random, mm, degrees, centre=(0.0, 0.0, 0.0)):
    axis, way = (vector / numpy.linalg.norm(vector)
                 for vector in ([random.gauss(0, 1) for _ in range(3)] for _ in range(2)))
    x, y, z = axis
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = numpy.radians(random.uniform(0, degrees))
    T = numpy.eye(4)
    T[:3, :3] += numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross
    centre = numpy.asarray(centre)
    T[:3, 3] = centre - T[:3, :3] @ centre + random.uniform(0, mm) * way
    return T


def call(name, kind, *arguments, limit_s=20.0):
    """The answer of a service; None if there is none, as while its node is dead."""
    try:
        rospy.wait_for_service(name, limit_s)
        return rospy.ServiceProxy(name, kind)(*arguments)
    except (rospy.ServiceException, rospy.ROSException, OSError):
        return None


class Session:
    def __init__(self, plan, anatomies, frames):
        self.plan, self.random = plan, random_module.Random(plan["seed"])
        self.frames = frames                      # by name of the anatomy
        sweeps = [Sweep(*sweep) for sweep in plan["sweeps"]]
        self.ledger = Ledger(anatomies, sweeps)
        self.ledger.last_accepted = plan["last_accepted"]
        self.known_sweeps = len(sweeps)
        self.counts = {}
        self.kills = []                           # (when, what)
        self.lock = threading.RLock()
        self.ended = threading.Event()
        self.T_fixed_us = numpy.array(plan["T_fixed_us"])
        self.jump_mm = 0.0
        self.ct_is_damaged = False
        self.ct_crc32 = self.result = self.alignment = None
        self.results = {}
        self.sweep_number = self.random.randrange(2**31)

    def count(self, what):
        with self.lock:
            self.counts[what] = self.counts.get(what, 0) + 1

    def connect(self):
        rospy.init_node("soak", disable_signals=True)
        publish = lambda topic, kind: rospy.Publisher(topic, kind, queue_size=100, tcp_nodelay=True)  # noqa: E731
        self.to_frames, self.to_tf = publish("/us/frames", mutations.RawFrame), publish("/tf", TFMessage)
        self.to_results = publish("/registration/result", RegistrationResult)
        self.to_volumes, self.to_cts = publish("/us/volume", PreScanVolume), publish("/ct/volume", CtVolume)
        self.buffer = tf2_ros.Buffer()
        # No TransformListener: in Python it ends the process at a stamp near the end of time.
        rospy.Subscriber("/tf", TFMessage, self.take_tf, tcp_nodelay=True)
        rospy.Subscriber("/ct/info", CtInfo, self.take_ct)
        rospy.Subscriber("/registration/result", RegistrationResult, self.take_result)
        rospy.Subscriber("/registration/alignment", Alignment, self.take_alignment)

    # Messages that arrive -----------------------------------------------------------------------

    def take_tf(self, message):
        for stamped in message.transforms:
            if stamped.child_frame_id == CT:
                self.buffer.set_transform(stamped, message._connection_header["callerid"])

    def take_ct(self, info):
        self.ct_crc32 = info.crc32

    def take_result(self, result):
        if result._connection_header["callerid"] == rospy.get_name():
            return
        self.count(f"result {result.status.code}")
        self.ct_is_damaged = result.status.code == StatusCode.INVALID_MESSAGE and result.status.message.startswith("CT ")
        self.results[result.us_stamp.to_nsec()] = result
        if result.status.code == StatusCode.REGISTERED:
            self.result = result

    def take_alignment(self, message):
        T = None if message.state == Alignment.NONE else matrix_of(message.transform)
        with self.lock:
            self.alignment = message
            self.ledger.alignment(time.time(), message.header.stamp.to_sec(), message.ct_crc32, T)
            if message.state != Alignment.ACCEPTED:
                return
            translation = message.transform.translation
            before = self.ledger.last_accepted
            self.ledger.accepted({"accepted_ns": message.accepted.to_nsec(),
                                  "translation_m": [translation.x, translation.y, translation.z]})
            if before is None or before["accepted_ns"] != message.accepted.to_nsec():
                self.count("accepted")
            self.ledger.file(read_file(self.plan["alignment_file"]), "after an accept")

    # Threads --------------------------------------------------------------------------------------

    def move_robot(self):
        last = rospy.Time()
        while not self.ended.wait(1.0 / TF_HZ):
            now = rospy.Time.now()
            if now <= last:
                continue
            last = now
            T = self.T_fixed_us.copy()
            T[0, 3] += self.jump_mm
            stamped = TransformStamped(child_frame_id=US, transform=message_of(T))
            stamped.header.stamp, stamped.header.frame_id = now, FIXED
            self.to_tf.publish(TFMessage([stamped]))

    def watch(self):
        while not self.ended.wait(1.0 / LOOK_UP_HZ):
            now = rospy.Time.now()
            try:
                T = matrix_of(self.buffer.lookup_transform(FIXED, CT, now).transform)
            except tf2_ros.TransformException:
                T = None
            with self.lock:
                self.ledger.look_up(now.to_sec(), T)

    def disturb(self):
        """Damaged messages and impossible requests, by other programs of the network."""
        random = random_module.Random(self.plan["seed"] + 1)
        while not self.ended.wait(random.expovariate(2.0)):
            now = rospy.Time.now()
            kind = random.choices(range(8), (4, 4, 1, 4, 4, 4, 4, 4))[0]
            if kind == 0:
                self.to_results.publish(mutations.damaged_result(random, self.result))
            elif kind == 1:
                self.to_volumes.publish(mutations.damaged_volume(random, now))
            elif kind == 2:
                self.to_cts.publish(mutations.damaged_ct(random, now))
            elif kind == 3:
                request = SetInitialAlignmentRequest(type=random.choice((1, 2, 3, 9)))
                request.header.frame_id = random.choice(("", "nowhere", "/us", US))
                request.transform.translation.x = mutations.NAN
                call("/registration/set_initial_alignment", SetInitialAlignment, request, limit_s=1.0)
            elif kind == 4:
                call("/ct/load", LoadCt, random.choice(("../ct.nrrd", "/etc/passwd", "no.nrrd", "damaged.nrrd", "")), "",
                     limit_s=1.0)
            elif kind == 5:
                call("/registration/accept", Decide, random.choice((1, 2**64 - 1)), limit_s=1.0)
            elif kind == 6:
                call("/ct/roi", SetCtRoi, *impossible_roi(random), limit_s=1.0)
            else:
                self.to_tf.publish(mutations.damaged_tf(random, now, FIXED, US))
            self.count("disturbances")

    def kill_nodes(self):
        random = random_module.Random(self.plan["seed"] + 2)
        from test_replay import pids_of_node
        while not self.ended.wait(random.expovariate(1.0 / self.plan["kill_every_s"])):
            name = random.choice(self.plan["nodes"])
            how = random.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP))
            for pid in pids_of_node(name, os.environ):
                try:
                    os.kill(pid, how)
                    if how == signal.SIGSTOP:
                        time.sleep(random.uniform(0.5, 3.0))
                        os.kill(pid, signal.SIGCONT)
                except ProcessLookupError:
                    continue
            self.count(f"{how.name} {name}")
            self.kills.append((time.time(), f"{how.name} {name}"))

    # The operator ---------------------------------------------------------------------------------

    def send_sweep(self, anatomy):
        """One sweep; some have frames that are damaged or missing, or a probe that jumps."""
        now = time.time()
        trouble = self.random.choices(("good", "damaged", "missing", "far", "jump"), (60, 20, 7, 6, 7))[0]
        self.count(f"sweeps {trouble}")
        frames = self.frames[anatomy]
        shift = self.random.choice((-1, 1)) * self.random.choice(mutations.FAR_S[:3]) if trouble == "far" else 0.0
        share = self.random.choice((0.02, 0.3)) if trouble in ("damaged", "missing") else 0.0
        self.sweep_number = (self.sweep_number + 1) % 2**32
        last = now + (len(frames) - 1) / FRAME_HZ
        with self.lock:
            self.ledger.add_sweep(Sweep(now, last, anatomy, self.T_fixed_us))
        for index, frame in enumerate(frames):
            due = now + index / FRAME_HZ
            time.sleep(max(0.0, due - time.time()))
            message = mutations.raw_frame(frame)
            message.header.stamp = rospy.Time.from_sec(due + shift)
            message.header.frame_id, message.sweep = US, self.sweep_number
            self.jump_mm = 100.0 if trouble == "jump" and index > len(frames) // 2 else 0.0
            if self.random.random() < share:
                if trouble == "missing":
                    continue
                message = mutations.damaged_frame(self.random, message, message.header.stamp)
            self.publish(message)
        time.sleep(0.1)
        self.jump_mm = 0.0
        return last

    def publish(self, message):
        try:
            self.to_frames.publish(message)
        except rospy.ROSException:
            self.count("frames that could not be sent")  # numbers beyond their type

    def exchange_ct(self):
        name = self.random.choice([anatomy.name for anatomy in self.ledger.anatomies.values()])
        if call("/ct/load", LoadCt, f"{name}/ct.nrrd", "") is not None:
            self.count("CTs loaded")

    def set_start(self, anatomy):
        known = self.ledger.by_name[anatomy]
        centre = known.targets_ct.mean(axis=0)
        T = self.T_fixed_us @ known.T_us_ct @ small_motion(self.random, 6.0, 3.0, centre)
        request = SetInitialAlignmentRequest(type=SetInitialAlignmentRequest.POSE, transform=message_of(T))
        request.header.frame_id = FIXED
        call("/registration/set_initial_alignment", SetInitialAlignment, request, limit_s=2.0)

    def operate_once(self):
        if self.ct_is_damaged or self.random.random() < 0.08:
            self.exchange_ct()
            self.ct_is_damaged = False
        anatomy = self.ledger.anatomies.get(self.ct_crc32)
        if anatomy is None:
            time.sleep(0.2)
            return
        if self.random.random() < 0.3:
            self.T_fixed_us = numpy.array(self.plan["T_fixed_us"]) @ small_motion(self.random, 60.0, 20.0)
        time.sleep(REST_S)
        if self.random.random() < 0.8:
            self.set_start(anatomy.name)
        last = self.send_sweep(anatomy.name)
        until = time.time() + 4.0
        while time.time() < until and not any(abs(stamp / 1e9 - last) < 1e-3 for stamp in list(self.results)):
            time.sleep(0.05)
        self.results.clear()
        time.sleep(REST_S)

    def restored(self):
        """The alignment that the system offers after its start, if it kept one and has its CT: in file and tf."""
        content = read_file(self.plan["alignment_file"])
        kept = (content or {}).get("alignment")
        if self.plan["is_first"] or not kept or kept["ct_crc32"] != self.plan["ct_crc32"]:
            return
        until = time.time() + 90.0
        while time.time() < until:
            if self.plan["restore"] == "confirm":
                call("/registration/accept", Decide, DecideRequest.KEPT, limit_s=5.0)
            if self.alignment is not None and self.alignment.state == Alignment.RESTORED:
                break
            time.sleep(0.3)
        t = self.alignment.transform.translation if self.alignment else None
        with self.lock:
            is_there = self.alignment is not None and self.alignment.state == Alignment.RESTORED
            self.ledger.offered((t.x, t.y, t.z) if is_there else None, content)
        self.count("restores")

    def run(self):
        self.connect()
        work = [self.move_robot, self.watch]
        threads = [threading.Thread(target=one, daemon=True) for one in work]
        for thread in threads:
            thread.start()
        self.restored()
        others = [self.disturb] + ([] if self.plan["calm"] else [self.kill_nodes])
        more = [threading.Thread(target=one, daemon=True) for one in others]
        for thread in more:
            thread.start()
        end = time.time() + self.plan["seconds"]
        while time.time() < end:
            self.operate_once()
            if self.plan["inject"] and time.time() > end - 0.5 * self.plan["seconds"]:
                self.inject()
        self.ended.set()
        for thread in threads + more:
            thread.join(30.0)
        return self.record()

    def inject(self):
        """A wrong transform, to see whether the watcher reports it."""
        stamped = TransformStamped(child_frame_id=CT, transform=message_of(small_motion(self.random, 500.0, 90.0)))
        stamped.header.frame_id = FIXED
        for i in range(20):
            stamped.header.stamp = rospy.Time.now() + rospy.Duration(0.2)
            self.to_tf.publish(TFMessage([stamped]))
            time.sleep(0.05)

    def record(self):
        with self.lock:
            ledger = self.ledger
            ledger.finish()
            return {"counts": self.counts, "kills": self.kills, "look_ups": ledger.look_ups, "without_transform": ledger.without_transform,
                    "worst_mm": ledger.worst_mm, "gaps": ledger.gaps, "faults": ledger.faults.counts,
                    "first": ledger.faults.first, "last_accepted": ledger.last_accepted,
                    "sweeps": [sweep.as_json() for sweep in ledger.sweeps[self.known_sweeps:]]}


def impossible_roi(random):
    from us_ct_registration.srv import SetCtRoiRequest
    request = SetCtRoiRequest(decimation=random.choice((17, 2**32 - 1)))
    return [request]


def read_file(path):
    """`content` of the file that keeps the alignment; None if there is none. It is replaced atomically."""
    try:
        with open(path) as stream:
            return json.load(stream)["content"]
    except FileNotFoundError:
        return None


def run(plan, anatomies, frames, record_path):
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    record = Session(plan, anatomies, frames).run()
    with open(record_path, "w") as stream:
        json.dump(record, stream)
