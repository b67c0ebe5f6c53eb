"""Measures the error with which the overlay shows the tumour: see `run`, which starts this.

One seed is one independent case: anatomy, ultrasound, camera and registration all differ. Several images of one video
share one registration, and so do registrations of one phantom from several starts: they are not independent.
"""
import argparse
import json
import pathlib
import sys
import tempfile

import numpy

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(PROJECT / "test/ros"))
import overlay_case  # noqa: E402: the path comes first
import test_replay  # noqa: E402

FRAMES = 6
# The band has held the true outline of a case if this share of it, over all images, lies in the band.
HELD = 0.995


def measured(seed, shift_mm, breathing_mm):
    with tempfile.TemporaryDirectory(prefix="usct_overlay_") as folder:
        folder = pathlib.Path(folder)
        case = overlay_case.OverlayCase(folder, "--seed", str(seed), "--endoscope-frames", str(FRAMES),
                                        "--endoscope-rate", "2", "--endoscope-breathing-mm", str(breathing_mm),
                                        shift_mm=shift_mm)
        system = test_replay.System(folder, case)
        try:
            overlay_case.start(system)
            if not overlay_case.register(system).startswith("success: True"):
                return None
            return overlay_case.measure(system)
        finally:
            overlay_case.stop(system)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="number of phantoms [10]")
    parser.add_argument("--first-seed", type=int, default=101, help="[101]")
    parser.add_argument("--shift", type=float, default=5.0, help="error of the start along each axis, mm [5]")
    parser.add_argument("--breathing", type=float, default=0.0,
                        help="peak-to-peak motion of the anatomy during the video, mm [0]")
    parser.add_argument("--output", type=pathlib.Path, help="all measures, JSON")
    options = parser.parse_args()
    print("| seed | TRE at the tumour, mm | outlines apart, px | mm | displaced, px | predicted, px | not explained, px "
          "| least share of the outline within the band |\n|---|---|---|---|---|---|---|---|", flush=True)
    results = {}
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        results[seed] = m = measured(seed, options.shift, options.breathing)
        if m is None:
            print(f"| {seed} | refused | | | | | | |", flush=True)
            continue
        print(f"| {seed} | {m['tre_at_tumour_mm']:.2f} | {m['outline_px']:.2f} | {m['outline_mm']:.2f} | "
              f"{m['displacement_px']:.2f} | {m['predicted_px']:.2f} | {m['unexplained_px']:.2f} | "
              f"{m['least_within_band']:.3f} |", flush=True)
        if options.output:
            options.output.write_text(json.dumps(results, indent=1) + "\n")
    done = [m for m in results.values() if m]
    if not done:
        sys.exit("nothing was registered")
    held = sum(m["least_within_band"] >= HELD for m in done)

    def mean(name):
        return float(numpy.mean([m[name] for m in done]))
    print(f"\n{len(done)} of {len(results)} cases registered. Means: TRE at the tumour {mean('tre_at_tumour_mm'):.2f} mm, "
          f"outlines apart {mean('outline_px'):.2f} px = {mean('outline_mm'):.2f} mm, displaced "
          f"{mean('displacement_px'):.2f} px, predicted {mean('predicted_px'):.2f} px, not explained "
          f"{mean('unexplained_px'):.2f} px (worst {max(m['unexplained_px'] for m in done):.2f}). The band held the true "
          f"outline in all images of {held} of {len(done)} independent cases.")


if __name__ == "__main__":
    main()
