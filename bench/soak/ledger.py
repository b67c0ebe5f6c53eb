"""The truth of a session, and the comparison of the system's statements with it. Knows no ROS.
Transforms are 4 x 4, mm; times are s."""
import bisect

import numpy

# Largest error, over the kidney's surface, of a transform that is right.
TOLERANCE_MM = 5.0
# A look-up is compared with the alignments that were in force so long before and after it: messages reach the watcher
# late on a busy machine, and tf may hold an alignment for transform_tolerance after it has ended.
GRACE_S = 2.0


class Sweep:
    """An acquisition: when its frames were taken, the anatomy in view, and where the ultrasound's frame was."""

    def __init__(self, first, last, anatomy, T_fixed_us):
        self.first, self.last, self.anatomy, self.T_fixed_us = first, last, anatomy, numpy.asarray(T_fixed_us)

    def as_json(self):
        return [self.first, self.last, self.anatomy, self.T_fixed_us.tolist()]


class Anatomy:
    """A phantom: its name, `p_us = T_us_ct p_ct`, the checksum of its CT and points on the kidney's surface in the CT."""

    def __init__(self, name, T_us_ct, ct_crc32, targets_ct):
        self.name, self.T_us_ct, self.ct_crc32 = name, numpy.asarray(T_us_ct), ct_crc32
        self.targets_ct = numpy.asarray(targets_ct)

    def error_mm(self, T, T_true):
        """Largest distance between the targets at two poses."""
        apart = T - T_true
        return float(numpy.linalg.norm(self.targets_ct @ apart[:3, :3].T + apart[:3, 3], axis=1).max())


class Faults:
    """Faults in words; the first of each kind with its details."""

    def __init__(self):
        self.counts, self.first = {}, {}

    def add(self, kind, details):
        self.counts[kind] = self.counts.get(kind, 0) + 1
        self.first.setdefault(kind, details)


class Ledger:
    """Sweeps, alignments and look-ups, judged as they come."""

    def __init__(self, anatomies, sweeps=()):
        self.anatomies = {anatomy.ct_crc32: anatomy for anatomy in anatomies}
        self.by_name = {anatomy.name: anatomy for anatomy in anatomies}
        self.sweeps = list(sweeps)
        self.faults = Faults()
        self._alignments = []   # (time of arrival, anatomy and true transform, or None)
        self._look_ups = []     # those that are not judged yet
        self.look_ups = self.without_transform = 0
        self.worst_mm = 0.0
        self.gaps = []          # (begin, length) of times without a transform although an alignment was in force
        self._gap_began = None
        self.last_accepted = None

    def add_sweep(self, sweep):
        self.sweeps.append(sweep)

    def sweep_at(self, stamp):
        return next((sweep for sweep in reversed(self.sweeps) if sweep.first - 1e-3 <= stamp <= sweep.last + 1e-3), None)

    def truth(self, stamp, ct_crc32):
        """The anatomy and `T_fixed_ct` of an alignment of ultrasound of this stamp; None if there is no such truth."""
        sweep, anatomy = self.sweep_at(stamp), self.anatomies.get(ct_crc32)
        if sweep is None or anatomy is None or sweep.anatomy != anatomy.name:
            return None
        return anatomy, sweep.T_fixed_us @ anatomy.T_us_ct

    def alignment(self, now, stamp, ct_crc32, T):
        """registration/alignment says that T is in force (or None that none is) for ultrasound of this stamp."""
        if T is None:
            self._alignments.append((now, None))
            return
        truth = self.truth(stamp, ct_crc32)
        if truth is None:
            self.faults.add("an alignment without truth", f"stamp {stamp:.3f}, CT {ct_crc32}: no sweep shows that")
            # The transforms that it puts into tf are not reported again at each look-up.
            truth = next(iter(self.anatomies.values())), T
        else:
            error = truth[0].error_mm(T, truth[1])
            self.worst_mm = max(self.worst_mm, error)
            if error > TOLERANCE_MM:
                self.faults.add("a wrong alignment", f"{error:.1f} mm off at stamp {stamp:.3f}")
        self._alignments.append((now, truth))

    def look_up(self, now, T):
        """The CT was looked up in tf at the present time; T is None if there was no transform."""
        self._look_ups.append((now, T))
        while self._look_ups and self._look_ups[0][0] < now - GRACE_S:
            self._judge(*self._look_ups.pop(0))

    def finish(self):
        while self._look_ups:
            self._judge(*self._look_ups.pop(0))
        self._end_gap(None)

    def in_force(self, begin, end):
        """The alignments that were in force at some time between."""
        first = bisect.bisect_right([when for when, _ in self._alignments], begin) - 1
        before = [None] if first < 0 else []
        return before + [truth for when, truth in self._alignments[max(0, first):] if when <= end]

    def _judge(self, when, T):
        self.look_ups += 1
        around = self.in_force(when - GRACE_S, when + GRACE_S)
        if T is None:
            self.without_transform += 1
            if around and None not in around and self._gap_began is None:
                self._gap_began = when
            return
        self._end_gap(when)
        errors = [truth[0].error_mm(T, truth[1]) for truth in around if truth is not None]
        if not errors:
            self.faults.add("a transform without an alignment", f"at {when:.3f}: translation {T[:3, 3].round(1)} mm")
        elif min(errors) > TOLERANCE_MM:
            self.faults.add("a wrong transform", f"{min(errors):.1f} mm off at {when:.3f}")

    def _end_gap(self, when):
        if self._gap_began is not None and when is not None:
            self.gaps.append((self._gap_began, when - self._gap_began))
        self._gap_began = None

    def accepted(self, stored):
        """An alignment was accepted; `stored` is what its file must hold from now on."""
        self.last_accepted = stored

    def file(self, content, what):
        """The file that keeps the alignment, as it is now: not older than the last one that was accepted, and true."""
        if self.last_accepted is None:
            return
        kept = (content or {}).get("alignment")
        if not kept:
            self.faults.add("a lost alignment", f"{what}: the file holds none")
        elif kept["accepted_ns"] < self.last_accepted["accepted_ns"]:
            self.faults.add("a lost alignment", f"{what}: the file holds one that is older than the last")
        elif kept["accepted_ns"] == self.last_accepted["accepted_ns"] and \
                kept["translation_m"] != self.last_accepted["translation_m"]:
            self.faults.add("a lost alignment", f"{what}: the file holds another one of the same time")

    def offered(self, restored, content):
        """After a restart: what was offered (translation in m), or None; `content` of the file before the restart."""
        kept = (content or {}).get("alignment")
        if kept and restored is None:
            self.faults.add("a lost alignment", "it was not offered after a restart")
        elif kept and list(restored) != kept["translation_m"]:
            self.faults.add("a lost alignment", f"after a restart {restored} was offered, not {kept['translation_m']}")
