"""Study cases as another scanner, or another operator at it, would have recorded them."""
import gzip
import re
import shutil
import zlib

import numpy as np

from self_cases import smoothed

IMAGES = ("ct.nrrd", "us.nrrd")
KINDS = {"short": "<i2", "int16": "<i2", "unsigned char": "u1", "uint8": "u1"}


class Image:
    """A NRRD file of three dimensions: its header as it is, and its values, slowest axis first."""

    def __init__(self, path):
        header, data = path.read_bytes().split(b"\n\n", 1)
        self.header = header.decode()
        self.kind = KINDS[self.field("type")]
        if self.field("encoding") == "gzip":
            data = gzip.decompress(data)
        size = [int(count) for count in self.field("sizes").split()]
        self.values = np.frombuffer(data, self.kind).reshape(size[::-1]).astype(np.float32)

    def field(self, name):
        return re.search(rf"^{name}: (.*)$", self.header, re.M).group(1)

    def set_field(self, name, value):
        self.header = re.sub(rf"^{name}: .*$", lambda _: f"{name}: {value}", self.header, flags=re.M)

    def vectors_mm(self, name):
        return np.array([[float(x) for x in vector.split(",")] for vector in re.findall(r"\(([^)]*)\)", self.field(name))])

    def set_vectors_mm(self, name, vectors_mm):
        self.set_field(name, " ".join("(" + ",".join(map(repr, map(float, vector))) + ")" for vector in vectors_mm))

    def write(self, path):
        low, high = (0, 255) if self.kind == "u1" else (-1024, 3071)
        self.set_field("sizes", " ".join(map(str, self.values.shape[::-1])))
        self.set_field("encoding", "gzip")
        values = np.clip(np.round(self.values), low, high).astype(self.kind)
        path.write_bytes(self.header.encode() + b"\n\n" + gzip.compress(values.tobytes(), 1))


def depth(us):
    """0 at the first sample of a line, 1 at the last."""
    return np.linspace(0.0, 1.0, us.values.shape[2])


def side(us):
    """-1 at the first line, 1 at the last."""
    return np.linspace(-1.0, 1.0, us.values.shape[1])[:, None]


def curved(us, exponent):
    us.values = 255.0 * (us.values / 255.0) ** exponent


def with_contrast(us):
    us.values = 255.0 / (1.0 + np.exp((110.0 - us.values) / 18.0))


def with_gain_over_depth(us, factor, first, last):
    us.values = factor * us.values + first + (last - first) * depth(us)


def focused(us):
    us.values = us.values + 35.0 * np.exp(-(((depth(us) - 0.5) / 0.08) ** 2)) - 25.0 * np.abs(side(us))


def with_noise(image, deviation):
    # Of each image its own, and the same each time.
    seed = zlib.crc32(np.ascontiguousarray(image.values).tobytes())
    image.values = image.values + np.random.default_rng(seed).normal(0.0, deviation, image.values.shape)


def without_contact(us):
    lost = int(0.35 * us.values.shape[1])
    us.values[:, :lost] = np.minimum(us.values[:, :lost], 6.0)


def in_slices(ct, thickness_mm):
    """Averages neighbouring slices; those left over at the end are dropped."""
    axes_mm, origin_mm = ct.vectors_mm("space directions"), ct.vectors_mm("space origin")
    together = max(1, round(thickness_mm / np.linalg.norm(axes_mm[2])))
    count = ct.values.shape[0] // together
    ct.values = ct.values[: count * together].reshape(count, together, *ct.values.shape[1:]).mean(axis=1)
    ct.set_vectors_mm("space origin", origin_mm + 0.5 * (together - 1) * axes_mm[2])
    axes_mm[2] *= together
    ct.set_vectors_mm("space directions", axes_mm)


def with_less_contrast(ct):
    """A third of the contrast of soft tissue, as with little contrast agent, and noise of 12 HU."""
    is_soft = (ct.values > -20.0) & (ct.values < 300.0)
    ct.values = np.where(is_soft, 40.0 + 0.3 * (ct.values - 40.0), ct.values)
    with_noise(ct, 12.0)


def blurred(ct, sigma_voxels):
    """Beyond its ends the CT goes on as at its ends."""
    margin = 10
    padded = smoothed(np.pad(ct.values, margin, "edge"), sigma_voxels)
    return padded[margin:-margin, margin:-margin, margin:-margin]


def softened(ct):
    ct.values = blurred(ct, [1.0, 2.5, 2.5])


def sharpened(ct):
    ct.values = ct.values + 2.0 * (ct.values - blurred(ct, [0.5, 1.5, 1.5]))
    with_noise(ct, 20.0)


# Which image, and what is done to it.
ALTERATIONS = {
    "none": ("us.nrrd", lambda us: None),
    "bright": ("us.nrrd", lambda us: curved(us, 0.5)),
    "dark": ("us.nrrd", lambda us: curved(us, 2.0)),
    "contrast": ("us.nrrd", with_contrast),
    "gainrises": ("us.nrrd", lambda us: with_gain_over_depth(us, 0.9, -60.0, 40.0)),
    "gainfalls": ("us.nrrd", lambda us: with_gain_over_depth(us, 1.0, 0.0, -45.0)),
    "focus": ("us.nrrd", focused),
    "noise": ("us.nrrd", lambda us: with_noise(us, 25.0)),
    "nocontact": ("us.nrrd", without_contact),
    "ctslices": ("ct.nrrd", lambda ct: in_slices(ct, 5.0)),
    "ctnoise": ("ct.nrrd", lambda ct: with_noise(ct, 50.0)),
    "ctpale": ("ct.nrrd", with_less_contrast),
    "ctsoft": ("ct.nrrd", softened),
    "ctsharp": ("ct.nrrd", sharpened),
}


def write_altered(case, folder, alteration):
    """Writes the case, with one image altered, into an empty folder. Labels are left out."""
    altered, alter = ALTERATIONS[alteration]
    for path in case.iterdir():
        if path.suffix in (".tfm", ".csv") or path.name in IMAGES and path.name != altered:
            shutil.copy(path, folder)
    image = Image(case / altered)
    alter(image)
    image.write(folder / altered)
