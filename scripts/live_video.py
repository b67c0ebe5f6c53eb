"""Bags of a frame grabber's images and a tracked probe, and what us_ingest must know of them."""
import gzip
import re

import numpy
import rosbag
import rospy
import yaml
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage

from demo_client import MM_PER_M, quaternion_of

US_FRAME, PROBE_FRAME, FIXED_FRAME, CT_FRAME = "us", "tracked_probe", "patient", "ct"


def matrix_of_euler(pose):
    """Of "x y z" and a translation, in rad and mm: rotations about z, then x, then y, as of ITK's Euler angles."""
    x, y, z, *translation = map(float, pose.split())
    (cx, sx), (cy, sy), (cz, sz) = [(numpy.cos(angle), numpy.sin(angle)) for angle in (x, y, z)]
    T = numpy.eye(4)
    T[:3, :3] = numpy.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ \
        numpy.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ numpy.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    T[:3, 3] = translation
    return T


def stamped(parent, child, stamp_s, T_mm):
    message = TransformStamped()
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    message.header.frame_id, message.child_frame_id = parent, child
    for axis, position in zip("xyz", T_mm[:3, 3] / MM_PER_M):
        setattr(message.transform.translation, axis, position)
    message.transform.rotation = quaternion_of(T_mm[:3, :3])
    return message


def write(path, pictures, stamps_s, T_us_probe, T_fixed_us, pause_s, T_us_ct=None):
    """Writes the pictures (each rows x columns, uint8) and the probe's poses at their stamps. tf has the pose of the
    ultrasound's frame, which stands still, from half a second before to pause_s after. T_us_ct: the truth."""
    messages = []
    if T_us_ct is not None:
        messages.append((stamps_s[0] - 0.5, "/truth/alignment",
                         stamped(FIXED_FRAME, CT_FRAME, stamps_s[-1], T_fixed_us @ T_us_ct)))
    for stamp_s in numpy.arange(stamps_s[0] - 0.5, stamps_s[-1] + pause_s, 0.1):
        messages.append((stamp_s, "/tf", TFMessage([stamped(FIXED_FRAME, US_FRAME, stamp_s, T_fixed_us)])))
    # The probe comes as it goes on, since images that lag show where it was before, and is held still in the end.
    before = T_us_probe[0] @ numpy.linalg.matrix_power(numpy.linalg.inv(T_us_probe[1]) @ T_us_probe[0], 6)
    shown = [(stamps_s[0] - 6 * (stamps_s[1] - stamps_s[0]), before), *zip(stamps_s, T_us_probe),
             (stamps_s[-1] + 0.5, T_us_probe[-1])]
    for stamp_s, T in shown:
        messages.append((stamp_s, "/tf", TFMessage([stamped(US_FRAME, PROBE_FRAME, stamp_s, T)])))
    for picture, stamp_s in zip(pictures, stamps_s):
        messages.append((stamp_s, "/us/image", image_of(picture, stamp_s)))
    write_messages(path, messages)


def image_of(picture, stamp_s):
    image = Image(encoding="mono8", height=picture.shape[0], width=picture.shape[1], step=picture.shape[1],
                  data=picture.tobytes())
    image.header.stamp = rospy.Time.from_sec(stamp_s)
    image.header.frame_id = "grabber"
    return image


def write_messages(path, messages):
    """Writes a bag of (time in s, topic, message); those below /truth are latched."""
    with rosbag.Bag(str(path), "w") as bag:
        for stamp_s, topic, message in sorted(messages, key=lambda entry: entry[0]):
            connection = {"topic": topic, "type": message._type, "md5sum": message._md5sum,
                          "message_definition": message._full_text, "latching": str(int(topic.startswith("/truth")))}
            bag.write(topic, message, rospy.Time.from_sec(stamp_s), connection_header=connection)


def describe(path, probe, picture, **parameters):
    """Writes the file for the argument `images` of registration.launch; `probe`: its YAML, place and sampling."""
    path.write_text(yaml.safe_dump({
        "source": "images", "image_size": [picture.shape[1], picture.shape[0]], "probe": str(probe.file),
        "samples": probe.samples, "image_origin_px": [float(x) for x in probe.origin_px],
        "image_spacing_mm": [float(x) for x in probe.pixel_mm], "pose_frame": US_FRAME, "image_frame": PROBE_FRAME,
        "sweep_control": "pause", **parameters}))
    return f"images:={path}"


class Sweep:
    """A tracked sweep in the project's format: uint8 frames x lines x samples, poses, and, if curvilinear, the fan."""

    def __init__(self, path):
        header, voxels = path.read_bytes().split(b"\n\n", 1)
        fields = dict(re.findall(r"^(\w+):=(.*)$", header.decode(), flags=re.M))
        size = [int(n) for n in re.search(rb"^sizes: (.*)$", header, re.M).group(1).split()]
        if b"encoding: gzip" in header:
            voxels = gzip.decompress(voxels)
        self.samples = numpy.frombuffer(voxels, numpy.uint8).reshape(size[::-1])
        self.start_mm, self.spacing_mm = float(fields["start_depth_mm"]), float(fields["sample_spacing_mm"])
        self.radius_mm = float(fields.get("probe_radius_mm", 0))
        self.angles_rad = numpy.radians([float(x) for x in fields.get("line_angles_deg", "").split()])
        self.times_s = [float(x) for x in fields.get("frame_times_s", "").split()]
        self.T_us_frame = numpy.tile(numpy.eye(4), (size[2], 1, 1))
        for T, pose in zip(self.T_us_frame, fields["frame_poses_mm"].split(";")):
            T[:3] = numpy.array([float(x) for x in pose.split()]).reshape(3, 4)


class PicturedProbe:
    """The fan of a sweep as a scanner shows it: scan-converted to square pixels, black around the fan."""

    def __init__(self, sweep, file, pixel_mm=0.4):
        depth_mm = sweep.start_mm + (sweep.samples.shape[2] - 1) * sweep.spacing_mm
        half_mm = (sweep.radius_mm + depth_mm) * numpy.sin(numpy.abs(sweep.angles_rad).max()) + 2.0
        top_mm = sweep.radius_mm * numpy.cos(sweep.angles_rad).min() - 2.0
        columns = 2 * int(half_mm / pixel_mm) + 1
        rows = int((sweep.radius_mm + depth_mm - top_mm + 2.0) / pixel_mm)
        self.origin_px, self.pixel_mm = [(columns - 1) / 2, -top_mm / pixel_mm], [pixel_mm, pixel_mm]
        self.file, self.samples = file, sweep.samples.shape[2]
        angles = " ".join(f"{x:.9f}," for x in numpy.degrees(sweep.angles_rad))
        file.write_text(f"name: test\nkind: curvilinear\nprobe_radius_mm: {sweep.radius_mm}\n"
                        f"line_angles_deg: [{angles}]\nstart_depth_mm: {sweep.start_mm}\n"
                        f"sample_spacing_mm: {sweep.spacing_mm}\n")
        x, y = numpy.meshgrid((numpy.arange(columns) - self.origin_px[0]) * pixel_mm,
                              (numpy.arange(rows) - self.origin_px[1]) * pixel_mm)
        count = len(sweep.angles_rad)
        self.line = numpy.interp(numpy.arctan2(x, y), sweep.angles_rad, numpy.arange(count), left=-1, right=-1)
        self.sample = (numpy.hypot(x, y) - sweep.radius_mm - sweep.start_mm) / sweep.spacing_mm
        self.shown = (self.line >= 0) & (self.sample >= 0) & (self.sample <= self.samples - 1)

    def picture(self, frame):
        """The picture of lines x samples."""
        lines, samples = self.line[self.shown], self.sample[self.shown]
        line = numpy.minimum(lines.astype(int), frame.shape[0] - 2)
        sample = numpy.minimum(samples.astype(int), frame.shape[1] - 2)
        across, along = lines - line, samples - sample
        grey = ((frame[line, sample] * (1 - along) + frame[line, sample + 1] * along) * (1 - across) +
                (frame[line + 1, sample] * (1 - along) + frame[line + 1, sample + 1] * along) * across)
        picture = numpy.zeros(self.line.shape, numpy.uint8)
        picture[self.shown] = numpy.round(grey)
        return picture
