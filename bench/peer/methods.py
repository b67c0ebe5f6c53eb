"""The two programs that are compared, each run as a whole process from the same start."""
import gzip
import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import time

import numpy as np

import geometry

HERE = pathlib.Path(__file__).resolve().parent
ULTRASOUND = {"raw": [], "flattened": ["--normalise", "flattened"],
              "z-score": ["--normalise", "z-score"]}
PYRAMID = (8, 4, 2, 1)
REFUSED = 3  # exit status of `usct register`
NO_OVERLAP = "Too many samples map outside moving image buffer"  # elastix' one refusal


def find_usct():
    """The build's, or the installed one."""
    built = HERE.parents[1] / "build/devel/lib/us_ct_registration/usct"
    found = str(built) if built.exists() else shutil.which("usct")
    if not found:
        sys.exit("usct is not built: cmake --build build --target usct, or give --usct")
    return found


def find_elastix():
    found = shutil.which("elastix")
    if not found:
        sys.exit("elastix is not installed: sudo apt-get install elastix (or --peer with no value)")
    return found


def timed(command, log, threads):
    """Exit status and seconds of the process: wall, and CPU of all its threads."""
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads))  # of elastix; usct has --threads
    cpu = cpu_seconds_of_children()
    began = time.perf_counter()
    with open(log, "w") as file:
        status = subprocess.run(list(map(str, command)), stdout=file, stderr=subprocess.STDOUT,
                                env=environment, check=False).returncode
    wall = time.perf_counter() - began
    return status, {"seconds": wall, "cpu_seconds": cpu_seconds_of_children() - cpu}


def cpu_seconds_of_children():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def checked(command, log, threads):
    status, seconds = timed(command, log, threads)
    if status != 0:
        sys.exit(f"{' '.join(map(str, command))}\nended with status {status}:\n{log.read_text()}")
    return seconds["seconds"]


def clamp_ct(source, target, low_hu, high_hu):
    """Of a NRRD as usct writes it."""
    header, _, data = pathlib.Path(source).read_bytes().partition(b"\n\n")
    if b"encoding: gzip" in header:
        header = header.replace(b"encoding: gzip", b"encoding: raw")
        data = gzip.decompress(data)
    if not re.search(rb"^type: (int16|short)", header, re.M) or b"encoding: raw" not in header:
        raise ValueError(f"{source}: 'type' or 'encoding' is not that of a CT, must be int16, raw")
    voxels = np.clip(np.frombuffer(data, "<i2"), low_hu, high_hu)
    pathlib.Path(target).write_bytes(header + b"\n\n" + voxels.astype("<i2").tobytes())


def spacing_mm(path):
    """Of a NRRD volume, along its index axes."""
    header = pathlib.Path(path).read_bytes().partition(b"\n\n")[0].decode()
    axes = re.search(r"^space directions: (.*)$", header, re.M)[1]
    return [np.linalg.norm([float(word) for word in axis.split(",")])
            for axis in re.findall(r"\(([^)]*)\)", axes)]


def pyramid(image, path, unit):
    """Schedule in whole voxels, of levels in "mm" or "voxels"."""
    voxel = spacing_mm(path) if unit == "mm" else (1.0, 1.0, 1.0)
    factors = [max(1, round(level / size)) for level in PYRAMID for size in voxel]
    return f"({image}ImagePyramidSchedule {' '.join(map(str, factors))})\n"


class Elastix:
    """Rigid registration of one case by elastix; `prepare` before `register`."""

    def __init__(self, options, kind):
        self.program = find_elastix()
        self.options = options
        self.kind = kind
        self.name = f"elastix, {kind}"

    def prepare(self, case, folder):
        """Scan conversion, normalisation and clamping: seconds of each."""
        self.folder = folder
        log = folder / "prepare.log"
        ct = folder / "ct.nrrd"
        convert = [self.options.usct, "convert", "--quiet"]
        seconds = checked([*convert, case / "us.nrrd", folder / "us.nrrd", "--scan-convert",
                           self.options.spacing_mm, "--mask", folder / "mask.nrrd",
                           *ULTRASOUND[self.kind]], log, self.options.threads)
        checked([*convert, case / "ct.nrrd", ct], log, self.options.threads)
        began = time.perf_counter()
        clamp_ct(ct, ct, *self.options.window_hu)
        (folder / "elastix.txt").write_text(
            (HERE / "elastix.txt").read_text()
            + pyramid("Fixed", folder / "us.nrrd", self.options.pyramid)
            + pyramid("Moving", ct, self.options.pyramid))
        return {"ultrasound": seconds, "ct": time.perf_counter() - began}

    def register(self, start_ct_us):
        initial = self.folder / "initial.txt"
        write_elastix_transform(start_ct_us, initial)
        output = self.folder / "elastix"
        shutil.rmtree(output, ignore_errors=True)
        output.mkdir()
        log = self.folder / "elastix.log"
        status, seconds = timed(
            [self.program, "-f", self.folder / "us.nrrd", "-fMask", self.folder / "mask.nrrd", "-m",
             self.folder / "ct.nrrd", "-t0", initial, "-p", self.folder / "elastix.txt", "-out",
             output, "-threads", self.options.threads], log, self.options.threads)
        if status != 0:
            if NO_OVERLAP not in log.read_text():
                sys.exit(f"elastix ended with status {status}:\n{log.read_text()}")
            return {**seconds, "status": "refused", "message": NO_OVERLAP}
        found = read_elastix_transform(output / "TransformParameters.0.txt", start_ct_us)
        return {**seconds, "status": "registered", "T_ct_us": found}


def write_elastix_transform(T_ct_us, path):
    """For -t0. elastix maps points of the fixed image (US) to the moving one (CT), as ITK does."""
    numbers = [*T_ct_us[:3, :3].flatten(), *T_ct_us[:3, 3]]
    path.write_text(f"""(Transform "AffineTransform")
(NumberOfParameters 12)
(TransformParameters {' '.join(map(repr, map(float, numbers)))})
(CenterOfRotationPoint 0 0 0)
(InitialTransformParametersFileName "NoInitialTransform")
(HowToCombineTransforms "Compose")
(FixedImageDimension 3)
(MovingImageDimension 3)
(FixedInternalImagePixelType "float")
(MovingInternalImagePixelType "float")
""")


def read_elastix_transform(path, start_ct_us):
    """T_ct_us: the Euler transform that was found, after the one given by -t0."""
    text = path.read_text()

    def numbers(name):
        return [float(word) for word in re.search(rf"^\({name} ([^)]*)\)", text, re.M)[1].split()]

    for expected in ('(Transform "EulerTransform")', '(HowToCombineTransforms "Compose")'):
        if expected not in text:
            raise ValueError(f"{path}: lacks {expected}")
    if '(ComputeZYX "true")' in text:
        raise ValueError(f"{path}: 'ComputeZYX' is true, must be false")
    values = numbers("TransformParameters")
    found = geometry.about_centre(geometry.euler_matrix(*values[:3]), values[3:],
                                  np.array(numbers("CenterOfRotationPoint")))
    return found @ start_ct_us


class Usct:
    """`usct register` with a preset."""

    def __init__(self, options, preset):
        self.options = options
        self.preset = [] if preset == "default" else ["--preset", preset]
        self.name = f"usct, {preset}"

    def prepare(self, case, folder):
        self.case = case
        self.folder = folder
        return {}

    def register(self, start_ct_us):
        initial = self.folder / "initial.tfm"
        result = self.folder / "result.json"
        log = self.folder / "usct.log"
        geometry.write_T_ct_us(start_ct_us, initial)
        result.unlink(missing_ok=True)
        status, seconds = timed(
            [self.options.usct, "register", "--ct", self.case / "ct.nrrd", "--us",
             self.case / "us.nrrd", "--initial", initial, *self.preset, "--output", result,
             "--threads", self.options.threads], log, self.options.threads)
        if status not in (0, REFUSED):
            sys.exit(f"usct register ended with status {status}:\n{log.read_text()}")
        found = json.loads(result.read_text()) if result.exists() else {}
        run = {**seconds, "status": "refused" if status == REFUSED else "registered",
               "message": found.get("message"), "stages": found.get("seconds", {}),
               "evaluations": found.get("evaluations")}
        run["seconds_in_memory"] = in_memory(run["stages"])
        if status == 0:
            run["T_ct_us"] = np.linalg.inv(np.reshape(found["T_us_ct"], (4, 4)))
        elif found.get("candidates"):
            run["best_candidate_T_ct_us"] = np.linalg.inv(
                np.reshape(found["candidates"][0]["T_us_ct"], (4, 4)))
        return run


def in_memory(stages):
    """Seconds without files; None if not told."""
    if "total" in stages:
        return stages["total"]
    computing = [seconds for stage, seconds in stages.items()
                 if not stage.startswith(("read", "load", "write"))]
    return sum(computing) if computing else None
