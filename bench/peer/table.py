"""Results as Markdown tables."""
import numpy as np

LIMITS_MM = (2, 3, 5)


def mean_of(values):
    return f"{np.mean(values):.2f}" if len(values) else "-"


def median_of(values, digits=2):
    return f"{np.median(values):.{digits}f}" if len(values) else "-"


def row(runs, success_mm):
    """Columns of one group, bin and method."""
    errors = np.array([run["tre_mm"] for run in runs if run["status"] == "registered"])
    successes = errors[errors < success_mm]
    shares = [f"{100.0 * np.count_nonzero(errors < limit) / len(runs):.0f} %"
              for limit in LIMITS_MM]
    memory = [run["seconds_in_memory"] for run in runs if run.get("seconds_in_memory") is not None]
    return [str(len(runs)), mean_of(successes), median_of(successes), median_of(errors), *shares,
            str(sum(run["status"] == "refused" for run in runs)),
            median_of([run["seconds"] for run in runs]),
            median_of([run["cpu_seconds"] for run in runs]), median_of(memory, 3)]


def ratio(runs, peers):
    """Median over the starts that both ran."""
    times = {key(run): run["seconds"] for run in peers}
    ratios = [times[key(run)] / run["seconds"] for run in runs if key(run) in times]
    return median_of(ratios, 1)


def key(run):
    return run["case"], run["start"]


def markdown(runs, preparation, methods, success_mm):
    """Table of all runs; the first method is what the others' times are compared with."""
    head = ["cases", "start, mm", "method", "runs", f"mean TRE < {success_mm:g}", "median",
            "median of all", *(f"< {limit} mm" for limit in LIMITS_MM), "refused", "s",
            "CPU s", "s in memory", f"{methods[0]} / this"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    groups = list(dict.fromkeys(run["group"] for run in runs))
    bins = list(dict.fromkeys(run["bin"] for run in runs))
    for group in [*groups, "all"]:
        for start_bin in [*bins, "all"]:
            chosen = [run for run in runs if group in (run["group"], "all")
                      and start_bin in (run["bin"], "all")]
            for method in methods:
                of_method = [run for run in chosen if run["method"] == method]
                if of_method:
                    peers = [run for run in chosen if run["method"] == methods[0]]
                    cells = [group, start_bin, method, *row(of_method, success_mm),
                             ratio(of_method, peers)]
                    lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n\n" + preparation_table(preparation)


def preparation_table(preparation):
    """What elastix needs before it starts, once per case; not in the seconds above."""
    if not preparation:
        return ""
    lines = ["| before the start, median s per case | ultrasound | CT |", "|---|---|---|"]
    for method in dict.fromkeys(item["method"] for item in preparation):
        seconds = [item["seconds"] for item in preparation if item["method"] == method]
        lines.append(f"| {method} | {median_of([s['ultrasound'] for s in seconds])} | "
                     f"{median_of([s['ct'] for s in seconds])} |")
    return "\n".join(lines) + "\n"
