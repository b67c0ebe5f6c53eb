#!/usr/bin/python3
"""Registers phantom cases by elastix and by `usct register` from the same starts; see README.md."""
import argparse
import contextlib
import json
import pathlib
import sys
import tempfile
import zlib

try:
    import numpy as np
except ImportError:
    sys.exit("numpy is not installed: sudo apt-get install python3-numpy")

import geometry
import methods
import table


def arguments():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("cases", nargs="+", type=pathlib.Path, metavar="CASE",
                        help="folder that `usct phantom` wrote; grouped by its name up to '_'")
    parser.add_argument("--starts", type=int, default=3, help="per case and bin of displacement")
    parser.add_argument("--max-start-mm", type=float, default=30.0,
                        help="largest mean displacement of the targets at the start")
    parser.add_argument("--bin-mm", type=float, default=10.0, help="width of a bin")
    parser.add_argument("--seed", type=int, default=1, help="of the starts")
    parser.add_argument("--peer", nargs="*", choices=list(methods.ULTRASOUND), default=["z-score"],
                        help="ultrasound that elastix gets; no value: no elastix")
    parser.add_argument("--preset", nargs="*", default=["default"],
                        help="of usct register; no value: no usct")
    parser.add_argument("--usct", help="program; the build's if not given")
    parser.add_argument("--threads", type=int, default=2, help="of both")
    parser.add_argument("--spacing-mm", type=float, default=1.0, help="of elastix' ultrasound")
    parser.add_argument("--pyramid", choices=["mm", "voxels"], default="mm",
                        help="unit of elastix' levels 8-4-2-1")
    parser.add_argument("--window-hu", type=int, nargs=2, default=[-150, 250], help="elastix' CT")
    parser.add_argument("--success-mm", type=float, default=5.0, help="mean TRE of a success")
    parser.add_argument("--output", type=pathlib.Path, required=True,
                        help="folder for results.json and table.md")
    parser.add_argument("--keep", type=pathlib.Path,
                        help="folder for the images, logs and transforms of the last start")
    options = parser.parse_args()
    if not options.peer and not options.preset:
        parser.error("nothing to run: neither --peer nor --preset has a value")
    options.usct = options.usct or methods.find_usct()
    return options


def starts(case, options):
    """(bin, displacement, T_ct_us): the same for any other cases and methods of the run."""
    truth = geometry.read_T_ct_us(case / "truth.tfm")
    targets = geometry.read_points_mm(case / "targets.csv")
    random = np.random.default_rng([options.seed, zlib.crc32(case.name.encode())])
    low = 0.0
    while low < options.max_start_mm:
        high = min(low + options.bin_mm, options.max_start_mm)
        for _ in range(options.starts):
            displacement = random.uniform(low, high)
            yield (f"{low:g}-{high:g}", displacement,
                   geometry.draw_start(random, truth, targets, displacement))
        low = high


def registered(method, start_ct_us, truth, targets):
    """The run's figures, transforms as lists."""
    run = method.register(start_ct_us)
    if "T_ct_us" in run:
        errors = geometry.errors_mm(run["T_ct_us"], truth, targets)
        run.update(tre_mm=errors.mean(), tre_max_mm=errors.max())
    if "best_candidate_T_ct_us" in run:  # what would have come out without the refusal
        errors = geometry.errors_mm(run["best_candidate_T_ct_us"], truth, targets)
        run["best_candidate_tre_mm"] = errors.mean()
    return {name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in run.items()}


def compare_case(case, programs, options, folder, results):
    truth = geometry.read_T_ct_us(case / "truth.tfm")
    targets = geometry.read_points_mm(case / "targets.csv")
    for index, program in enumerate(programs):
        place = folder / case.name / str(index)
        place.mkdir(parents=True, exist_ok=True)
        seconds = program.prepare(case.resolve(), place)
        if seconds:
            results["preparation"].append({"case": case.name, "method": program.name,
                                           "seconds": seconds})
    for start, (start_bin, displacement, start_ct_us) in enumerate(starts(case, options)):
        for program in programs:
            run = registered(program, start_ct_us, truth, targets)
            results["runs"].append({"case": case.name, "group": case.name.split("_")[0],
                                    "method": program.name, "start": start, "bin": start_bin,
                                    "start_mm": displacement,
                                    "start_T_ct_us": start_ct_us.tolist(), **run})
            print(f"{case.name} {start_bin} mm, {program.name}: {run['status']}, "
                  f"TRE {run.get('tre_mm', float('nan')):.2f} mm, {run['seconds']:.2f} s",
                  file=sys.stderr, flush=True)


def write(results, programs, options):
    text = table.markdown(results["runs"], results["preparation"],
                          [program.name for program in programs], options.success_mm)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "results.json").write_text(json.dumps(results, indent=1, default=str) + "\n")
    (options.output / "table.md").write_text(text)
    return text


def main():
    options = arguments()
    programs = [*(methods.Elastix(options, kind) for kind in options.peer),
                *(methods.Usct(options, preset) for preset in options.preset)]
    results = {"options": vars(options), "preparation": [], "runs": []}
    with contextlib.ExitStack() as stack:
        folder = options.keep or pathlib.Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="usct_peer_")))
        text = ""
        for case in options.cases:
            compare_case(case, programs, options, folder, results)
            text = write(results, programs, options)
    print(text, end="")


if __name__ == "__main__":
    main()
