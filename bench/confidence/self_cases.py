"""Study cases from one tracked sweep: some of its frames become a CT, the others stay the ultrasound."""
import gzip
import json
import pathlib
import sys

import numpy as np

PROJECT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(PROJECT / "bench" / "peer"), str(PROJECT / "test" / "ros")]
import geometry  # noqa: E402
import real_sweeps  # noqa: E402,F401  (readers of the sweeps)

# Voxels beyond the sweep, so that its outline is not that of the CT.
MARGIN_MM = 15.0
SMOOTHING_MM = 1.5
TARGET_RADIUS_MM = 25.0
TARGETS = 100
# Grey value below which a picture shows nothing.
BLACK = 5.0


def chosen_frames(random, count, block, least_share):
    """Frames of the CT and of the ultrasound: blocks in turn, within a random part of the sweep."""
    used = int(round(count * random.uniform(least_share, 1.0)))
    first = random.integers(0, count - used + 1)
    frames = np.arange(first, first + used)
    of_ct = (np.arange(used) // block) % 2 == random.integers(0, 2)
    return frames[of_ct], frames[~of_ct]


def smoothed(volume, sigma_voxels):
    """Gaussian smoothing, one standard deviation per axis, of a volume that is zero beyond its ends."""
    for axis, sigma in enumerate(sigma_voxels):
        count = volume.shape[axis]
        padded = count + int(np.ceil(5 * sigma))
        shape = [1, 1, 1]
        shape[axis] = -1
        response = np.exp(-2.0 * (np.pi * sigma * np.fft.rfftfreq(padded)) ** 2).reshape(shape)
        volume = np.fft.irfft(np.fft.rfft(volume, padded, axis) * response, padded, axis)
        volume = volume.take(range(count), axis)
    return volume


class Grid:
    """Voxels of a CT, in the order k, j, i; `direction` has the axes i, j, k as columns."""

    def __init__(self, size, spacing_mm, origin_mm, direction):
        self.size, self.spacing_mm, self.origin_mm = np.array(size), np.array(spacing_mm), np.array(origin_mm)
        self.direction = np.array(direction)

    def index(self, points_mm):
        return (points_mm - self.origin_mm) @ self.direction / self.spacing_mm


def grid_around(points_mm, spacing_mm, direction):
    """The grid with these axes that holds all points and a margin around them."""
    along_axes = points_mm @ direction
    low = along_axes.min(axis=0) - MARGIN_MM
    size = np.ceil((along_axes.max(axis=0) + MARGIN_MM - low) / spacing_mm).astype(int) + 1
    return Grid(size, spacing_mm, direction @ low, direction)


def compounded(points_mm, values, grid):
    """Mean of the samples in each voxel, smoothed against speckle, and extended smoothly to where there is none.

    Normalised convolution by Gaussians of 1.5, 3, 6, ... mm: a wider one counts where the samples within reach of the
    narrower ones are few. The CT so has no edge where the field of view ends, which would give the pose away.
    Returns the volume (k, j, i), and a mask of the voxels that samples are within reach of.
    """
    enough = 0.1
    index = np.round(grid.index(points_mm)).astype(int)
    shape = tuple(grid.size[::-1])
    offset = np.ravel_multi_index((index[:, 2], index[:, 1], index[:, 0]), shape)
    count = np.bincount(offset, minlength=np.prod(shape)).reshape(shape)
    total = np.bincount(offset, weights=values, minlength=np.prod(shape)).reshape(shape)
    known = (count > 0).astype(float)
    mean = total / np.maximum(count, 1)
    volume = np.full(shape, values.mean())
    for step in range(4, -1, -1):
        sigma = SMOOTHING_MM * 2**step / grid.spacing_mm[::-1]
        share = smoothed(known, sigma)
        value = smoothed(mean, sigma) / np.maximum(share, 1e-6)
        weight = np.clip(share / enough, 0.0, 1.0)
        volume = weight * value + (1.0 - weight) * volume
    return volume, share > enough


def brightness_to_hu(random, brightness):
    """Knots (brightness, HU) of a map that rises, falls and rises, or the other way round, over what is not black."""
    quantiles = [0.02, random.uniform(0.3, 0.45), random.uniform(0.6, 0.8), 0.99]
    hu = [random.uniform(-100, -20), random.uniform(60, 140), random.uniform(-40, 20), random.uniform(180, 320)]
    if random.integers(0, 2):
        hu = [100.0 - value for value in hu]
    knots = np.quantile(brightness[brightness > BLACK], quantiles)
    return knots + 1e-3 * np.arange(4), np.array(hu)  # strictly rising, whatever the brightness


def ct_noise(random, shape):
    """Noise of a CT, HU: correlated between neighbours of a slice."""
    noise = smoothed(random.normal(size=shape), [0.0, 0.6, 0.6])
    return noise / noise.std() * random.uniform(8.0, 25.0)


def tilt(random):
    """A rotation by up to 15 degrees about a random axis."""
    axis = random.normal(size=3)
    return geometry.rotation_matrix(axis / np.linalg.norm(axis) * random.uniform(0.0, np.radians(15.0)))


def quarter_turns(random):
    """One of the 24 rotations that map the axes to each other."""
    R = np.eye(3)[random.permutation(3)] * random.choice([-1.0, 1.0], 3)
    return R * np.linalg.det(R)


def on_sphere(count, centre_mm, radius_mm):
    """Points that are spread evenly over a sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return centre_mm + radius_mm * np.stack([r * np.cos(angle), r * np.sin(angle), z], -1)


def write_nrrd(path, voxels, fields):
    """`voxels` with the slowest axis first."""
    sizes = " ".join(map(str, voxels.shape[::-1]))
    header = ["NRRD0004", f"dimension: 3\nsizes: {sizes}\nencoding: gzip\nendian: little", *fields, "\n"]
    path.write_bytes("\n".join(header).encode() + gzip.compress(np.ascontiguousarray(voxels).tobytes(), 6))


def write_ct(path, volume, grid):
    def vector(v):
        return "(" + ",".join(map(repr, map(float, v))) + ")"
    axes = " ".join(vector(axis) for axis in (grid.direction * grid.spacing_mm).T)
    write_nrrd(path, volume.astype("<i2"), ["type: short", "space: left-posterior-superior",
                                            f"space directions: {axes}", f"space origin: {vector(grid.origin_mm)}"])


def write_ultrasound(path, samples, probe, T_us_frame):
    """`samples`: frames x lines x samples, brightness."""
    def words(numbers):
        return " ".join(map(repr, map(float, numbers)))
    middle = (probe.lines - 1) / 2
    array = [f"probe_radius_mm:={probe.radius_mm!r}", f"line_pitch_deg:={probe.pitch!r}"]
    if probe.kind == "linear":
        array = [f"line_positions_mm:={words((np.arange(probe.lines) - middle) * probe.pitch)}"]
    poses = ";".join(words(T[:3].ravel()) for T in T_us_frame)
    write_nrrd(path, np.clip(np.round(samples), 0, 255).astype(np.uint8),
               ["type: unsigned char", f"usct_geometry:=tracked_{probe.kind}", "start_depth_mm:=0",
                f"sample_spacing_mm:={probe.spacing_mm!r}", *array, f"frame_poses_mm:={poses}"])


def write_points(path, points_mm):
    path.write_text("x,y,z\n" + "".join(",".join(map(repr, map(float, p))) + "\n" for p in points_mm))


def write_case(folder, pictures, seed, block, least_share):
    """Writes the files of a case into an empty folder. The same seed gives the same case."""
    random = np.random.default_rng(seed)
    ct_frames, us_frames = chosen_frames(random, len(pictures.pixels), block, least_share)
    samples, points_us_mm = pictures.samples(), pictures.points_us_mm()
    field_mm = points_us_mm[us_frames]
    centre_us_mm = 0.5 * (field_mm.min(axis=(0, 1, 2)) + field_mm.max(axis=(0, 1, 2)))

    # The axes of the CT and of the frames are tilted against each other, but so that the CT's box is not much larger
    # than the field.
    R_us_frame = pictures.T_us_frame()[us_frames[len(us_frames) // 2], :3, :3]
    T_ct_us = np.eye(4)
    T_ct_us[:3, :3] = tilt(random) @ quarter_turns(random) @ R_us_frame.T
    T_ct_us[:3, 3] = random.uniform(-200.0, 200.0, 3) - T_ct_us[:3, :3] @ centre_us_mm
    in_plane_mm = random.uniform(0.7, 1.0)
    spacing_mm = np.array([in_plane_mm, in_plane_mm, random.uniform(1.0, 2.0)])
    points_ct_mm = geometry.transformed(T_ct_us, points_us_mm[ct_frames].reshape(-1, 3))
    grid = grid_around(points_ct_mm, spacing_mm, tilt(random))
    volume, is_seen = compounded(points_ct_mm, samples[ct_frames].ravel(), grid)
    knots, hu = brightness_to_hu(random, volume[is_seen])
    volume = np.round(np.interp(volume, knots, hu) + ct_noise(random, volume.shape))

    targets_us_mm = on_sphere(TARGETS, centre_us_mm, TARGET_RADIUS_MM)
    write_ct(folder / "ct.nrrd", volume, grid)
    write_ultrasound(folder / "us.nrrd", samples[us_frames], pictures.probe, pictures.T_us_frame()[us_frames])
    geometry.write_T_ct_us(T_ct_us, folder / "truth.tfm")
    write_points(folder / "targets.csv", targets_us_mm)
    write_points(folder / "targets_ct.csv", geometry.transformed(T_ct_us, targets_us_mm))
    (folder / "self.json").write_text(json.dumps({
        "seed": seed, "block": block, "least_share": least_share, "ct_frames": ct_frames.tolist(),
        "us_frames": us_frames.tolist(), "brightness": knots.tolist(), "hu": hu.tolist()}, indent=1) + "\n")
