"""Real tracked sweeps of B-mode pictures, read without the project's code: brightness and positions of samples."""
import re
import zlib

import numpy

import video


def calibrated(T):
    """The pixels' axes, of their own length, made orthogonal: calibrations are affine, arrays rigid."""
    lengths = numpy.linalg.norm(T[:3, :2], axis=0)
    u, _, v = numpy.linalg.svd(T[:3, :2] / lengths, full_matrices=False)
    T = T.copy()
    T[:3, :2] = u @ v * lengths
    T[:3, 2] = numpy.cross(T[:3, 0], T[:3, 1]) / lengths.mean()
    return T


class Probe:
    """An array, its place in the pictures, and the sampling of its lines; frame coordinates as in the project."""

    def __init__(self, kind, radius_mm, lines, pitch, spacing_mm, samples, origin_px, pixel_mm):
        self.kind, self.radius_mm, self.lines, self.pitch = kind, radius_mm, lines, pitch
        self.spacing_mm, self.samples, self.origin_px, self.pixel_mm = spacing_mm, samples, origin_px, pixel_mm

    def options(self, path):
        """The options of usct; `path` becomes the probe's YAML."""
        array = {"curvilinear": f"probe_radius_mm: {self.radius_mm}\nline_pitch_deg: {self.pitch}\n",
                 "linear": f"line_pitch_mm: {self.pitch}\n"}
        path.write_text(f"name: test\nkind: {self.kind}\nlines: {self.lines}\n{array[self.kind]}start_depth_mm: 0\n"
                        f"sample_spacing_mm: {self.spacing_mm}\n")
        return ["--probe", path, "--image-origin", *self.origin_px, "--image-spacing", *self.pixel_mm, "--samples",
                self.samples]

    def points_mm(self):
        """The samples' x and y in frame coordinates, lines x samples x 2."""
        lines = (numpy.arange(self.lines) - (self.lines - 1) / 2) * self.pitch
        depths = numpy.arange(self.samples) * self.spacing_mm
        if self.kind == "linear":
            return numpy.stack(numpy.broadcast_arrays(lines[:, None], depths[None, :]), -1)
        angles, h = numpy.radians(lines)[:, None], self.radius_mm + depths[None, :]
        return numpy.stack([h * numpy.sin(angles), h * numpy.cos(angles)], -1)


class Pictures:
    """Pixels (pictures x rows x columns), their poses (4 x 4 each, pixel to mm), and times in s or None."""

    def __init__(self, pixels, T_us_pixel, times_s, probe):
        self.pixels, self.T_us_pixel, self.times_s, self.probe = pixels, T_us_pixel, times_s, probe

    def samples(self):
        """Brightness along the beams, pictures x lines x samples, not rounded."""
        columns, rows = numpy.moveaxis(self.probe.origin_px + self.probe.points_mm() / self.probe.pixel_mm, -1, 0)
        left, top = numpy.floor(columns).astype(int), numpy.floor(rows).astype(int)
        right, down = columns - left, rows - top
        pixels = self.pixels
        upper = pixels[:, top, left] * (1 - right) + pixels[:, top, left + 1] * right
        lower = pixels[:, top + 1, left] * (1 - right) + pixels[:, top + 1, left + 1] * right
        return upper * (1 - down) + lower * down

    def points_us_mm(self):
        """Positions of the samples, pictures x lines x samples x 3."""
        pixels = self.probe.origin_px + self.probe.points_mm() / self.probe.pixel_mm
        T = self.T_us_pixel
        return numpy.einsum("fij,lsj->flsi", T[:, :3, :2], pixels) + T[:, None, None, :3, 3]

    def T_us_frame(self):
        T = numpy.tile(numpy.eye(4), (len(self.T_us_pixel), 1, 1))
        x, y = [self.T_us_pixel[:, :3, axis] / self.probe.pixel_mm[axis] for axis in (0, 1)]
        T[:, :3, :3] = numpy.stack([x, y, numpy.cross(x, y)], -1)
        T[:, :3, 3] = self.T_us_pixel[:, :3, :2] @ self.probe.origin_px + self.T_us_pixel[:, :3, 3]
        return T


def write_sequence(path, pictures):
    """Writes the sweep in the format of Plus, not compressed."""
    count, rows, columns = pictures.pixels.shape
    header = ["ObjectType = Image", "NDims = 3", "BinaryData = True", "BinaryDataByteOrderMSB = False",
              "CompressedData = False", f"DimSize = {columns} {rows} {count}", "ElementSpacing = 1 1 1",
              "ElementType = MET_UCHAR", "UltrasoundImageOrientation = MF", "UltrasoundImageType = BRIGHTNESS"]
    for i, T in enumerate(pictures.T_us_pixel):
        name = f"Seq_Frame{i:04}_ImageToReferenceTransform"
        header += [f"{name} = {' '.join(map(repr, T.ravel().tolist()))}", f"{name}Status = OK",
                   f"Seq_Frame{i:04}_ImageStatus = OK"]
    path.write_bytes("\n".join([*header, "ElementDataFile = LOCAL\n"]).encode() + pictures.pixels.tobytes())


def liver(folder):
    """Human liver, convex probe; the fan is measured in the pictures: its edges meet 139 pixels above them."""
    mm = 0.3148
    T_world_image = numpy.loadtxt(folder / "image_to_world_row_major_mm.csv", delimiter=",").reshape(-1, 4, 4)
    # The origin is the picture's centre, y runs up.
    T_image_pixel = numpy.diag([mm, -mm, -1, 1])
    T_image_pixel[:2, 3] = [-369.5 * mm, 296.5 * mm]
    probe = Probe("curvilinear", 160.8 * mm, 128, 60 / 128, 0.6, 296, [369.5, -139.0], [mm, mm])
    pixels = video.pictures_of(folder / "liver_sweep_140f_739x593.h264")
    return Pictures(pixels, T_world_image @ T_image_pixel, None, probe)


def spine_calibration():
    """ImageToProbe of Plus' manual ("SpinePhantom"), mm; its axes are 3 degrees from orthogonal."""
    return calibrated(numpy.array([[-0.00157821, 0.0785919, -0.00803285, 15.3978],
                                   [-0.0839128, 0.00372697, 0.0153803, 49.5705],
                                   [0.0159024, 0.00714276, 0.0803604, -8.63446], [0, 0, 0, 1]]))


def write_calibration(path):
    numbers = " ".join(map(repr, spine_calibration().ravel().tolist()))
    path.write_text("<PlusConfiguration><CoordinateDefinitions><Transform From=\"Image\" To=\"Probe\" "
                    f"Matrix=\"{numbers}\"/></CoordinateDefinitions></PlusConfiguration>\n")


def spine(path):
    """A spine phantom, freehand, linear probe of 38 mm: columns 187 to 631 of the pictures, from row 12."""
    content = path.read_bytes()
    header, data = re.split(rb"ElementDataFile = LOCAL\r?\n", content, maxsplit=1)
    fields = dict(re.findall(r"^(\S+) = (.*?)\s*$", header.decode(), flags=re.M))
    columns, rows, count = map(int, fields["DimSize"].split())
    names = [f"Seq_Frame{i:04}_" for i in range(count)]
    T_tracker = {frame: numpy.array([fields[f"{name}{frame}ToTrackerTransform"].split() for name in names],
                                    float).reshape(-1, 4, 4) for frame in ("Probe", "Reference")}
    calibration = spine_calibration()
    pixel_mm = numpy.linalg.norm(calibration[:3, :2], axis=0)
    probe = Probe("linear", 0.0, 128, 37.9 / 128, 0.11, 420, [409.0, 12.0], pixel_mm.tolist())
    return Pictures(numpy.frombuffer(zlib.decompress(data), numpy.uint8).reshape(count, rows, columns),
                    numpy.linalg.inv(T_tracker["Reference"]) @ T_tracker["Probe"] @ calibration,
                    [float(fields[f"{name}Timestamp"]) for name in names], probe)
