"""Memory of processes over time, and whether it grows."""
import pathlib
import re
import statistics

# Caches and pools fill at first. In a manager of nodelets each thread of glibc keeps what it freed, so that its memory rises
# until each of its threads has loaded a CT.
WARM_UP_S = 240.0
# A life of a process after that is judged if it lasted so long.
LEAST_S = 240.0


def own_mib(pid):
    """A process's memory that no file backs, MiB; None if it has ended."""
    try:
        status = pathlib.Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    found = re.search(r"^RssAnon:\s+(\d+) kB", status, re.M)
    return int(found.group(1)) / 1024.0 if found else None


def thin(samples):
    return samples[::max(1, len(samples) // 150)]


class Lives:
    """Samples of processes by name and number: a node that was restarted begins a new life."""

    def __init__(self):
        self.samples = {}

    def sample(self, now, processes):
        """`processes`: names by number."""
        for pid, name in processes.items():
            mib = own_mib(pid)
            if mib is not None:
                self.add(name, pid, now, mib)

    def add(self, name, pid, now, mib):
        self.samples.setdefault((name, pid), []).append((now, mib))

    def growths(self):
        """Of each life that can be judged: name, length (s), median (MiB), peak (MiB), slope (MiB per hour) by Theil and
        Sen, which a single large message does not disturb, and growth over the life (MiB)."""
        for (name, _), samples in sorted(self.samples.items()):
            warm = [(when, mib) for when, mib in samples if when - samples[0][0] >= WARM_UP_S]
            if not warm or warm[-1][0] - warm[0][0] < LEAST_S:
                continue
            length = warm[-1][0] - warm[0][0]
            thinned = thin(warm)
            slopes = [(b[1] - a[1]) / (b[0] - a[0]) for i, a in enumerate(thinned) for b in thinned[i + 1:]]
            slope = statistics.median(slopes)
            sizes = [mib for _, mib in warm]
            yield name, length, statistics.median(sizes), max(sizes), 3600.0 * slope, slope * length
