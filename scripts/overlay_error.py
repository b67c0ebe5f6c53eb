#!/usr/bin/env python3
"""Measures how far video_overlay draws the tumour from where a synthetic endoscope truly has it.

While the bag of a case plays (usct phantom --endoscope, usct bag write --endoscope), this program compares the drawings
of overlay_error.launch with the masks of the truth, and prints the error at the tumour. It also prints the displacement
that the error of the registration predicts; that projection is written here and shares no code with the overlay.
"""
import argparse
import json
import pathlib
import re
import signal
import subprocess
import sys
import time

import numpy
import ros_graph

LIMIT_S = 120.0
QUIET_S = 5.0
# The video is replayed from this time before its first image.
BEFORE_VIDEO_S = 2.0
PLAYER = "/player_of_video"
TUMOUR = 2  # in segmentation.nrrd
GREEN, BAND = numpy.array([0, 255, 0]), numpy.array([255, 220, 0])
BAND_OPACITY = 0.5
# px: a true outline this near to the band lies within it; the drawn outline parts the band in two.
TOUCHING_PX = 1.5


class Camera:
    """A camera with plumb_bob distortion, as OpenCV documents it."""

    def __init__(self, path):
        text = path.read_text()
        K = self.numbers(text, "camera_matrix")
        self.focal, self.centre = numpy.array([K[0], K[4]]), numpy.array([K[2], K[5]])
        self.distortion = self.numbers(text, "distortion_coefficients")

    @staticmethod
    def numbers(text, key):
        return [float(x) for x in re.search(key + r":.*data: \[(.*?)\]", text).group(1).split(",")]

    def project(self, points_mm):
        """N x 3 in the optical frame to N x 2 pixels."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = (points_mm[:, :2] / points_mm[:, 2:]).T
        square = x * x + y * y
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        distorted = numpy.column_stack((x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
                                        y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y))
        return distorted * self.focal + self.centre


def moved(T, points):
    return points @ T[:3, :3].T + T[:3, 3]


def tumour_points(case, most=2000):
    """Positions in the CT of voxels of the tumour, mm, N x 3."""
    header, voxels = (case / "segmentation.nrrd").read_bytes().split(b"\n\n", 1)
    fields = dict(re.findall(r"^([\w ]+):=? ?(.*)$", header.decode(), flags=re.M))
    size = [int(n) for n in fields["sizes"].split()]
    vectors = numpy.array([[float(x) for x in v.split(",")]
                           for v in re.findall(r"\(([^)]*)\)", fields["space directions"])])
    origin = numpy.array([float(x) for x in fields["space origin"].strip("()").split(",")])
    k, j, i = numpy.nonzero(numpy.frombuffer(voxels, "<u2").reshape(size[::-1]) == TUMOUR)
    points = numpy.column_stack((i, j, k)) @ vectors + origin
    return points[::max(1, len(points) // most)]


def outline(mask):
    """Pixels (x, y) of a region that have a neighbour outside of it."""
    inner = mask.copy()
    inner[1:] &= mask[:-1]
    inner[:-1] &= mask[1:]
    inner[:, 1:] &= mask[:, :-1]
    inner[:, :-1] &= mask[:, 1:]
    y, x = numpy.nonzero(mask & ~inner)
    return numpy.column_stack((x, y)).astype(float)


def nearest(points, others):
    """Distance of each point to the nearest of the others."""
    return numpy.sqrt(((points[:, None] - others[None]) ** 2).sum(axis=2).min(axis=1))


def centre(mask):
    y, x = numpy.nonzero(mask)
    return numpy.array([x.mean(), y.mean()])


def near(image, colour, most=6):
    return (numpy.abs(image.astype(int) - colour) <= most).all(axis=2)


def is_text(shape):
    """The node writes in the lines at the top, and the names of the structures at the bottom left."""
    text = numpy.zeros(shape, bool)
    text[:shape[0] // 7] = True
    text[-shape[0] // 12:, :shape[1] // 4] = True
    return text


def without_text(mask):
    return mask & ~is_text(mask.shape)


def free_outline(mask):
    """The outline of a region without text, but for where the text cuts it."""
    points = outline(mask)
    beside = is_text(mask.shape)
    beside[1:] |= beside[:-1]
    beside[:-1] |= beside[1:]
    beside[:, 1:] |= beside[:, :-1]
    x, y = points.astype(int).T
    return points[~beside[y, x]]


def regions(drawn, raw):
    """The tumour as drawn, and the band around its outline, of a drawing of overlay_error.launch."""
    within = near(drawn, (1 - BAND_OPACITY) * GREEN + BAND_OPACITY * BAND)
    tumour = without_text(near(drawn, GREEN) | within)
    blended = (1 - BAND_OPACITY) * raw + BAND_OPACITY * BAND
    outside = near(drawn, blended, 4) & (numpy.abs(drawn.astype(int) - raw).max(axis=2) > 4)
    return tumour, without_text(within | outside)


def T_us_ct_of(path):
    """4 x 4, mm, of an ITK transform file, which maps points of the ultrasound to the CT."""
    numbers = [float(x) for x in re.search("^Parameters: (.*)$", path.read_text(), re.M).group(1).split()]
    T_ct_us = numpy.eye(4)
    T_ct_us[:3, :3], T_ct_us[:3, 3] = numpy.reshape(numbers[:9], (3, 3)), numbers[9:]
    return numpy.linalg.inv(T_ct_us)


class Case:
    """The truth of a case, and the error that a registration of it predicts."""

    def __init__(self, folder, result, truth):
        self.camera = Camera(folder / "endoscope/camera.yaml")
        self.video = json.loads((folder / "endoscope/endoscope.json").read_text())
        self.points_ct = tumour_points(folder)
        found = numpy.array(json.loads(pathlib.Path(result).read_text())["T_us_ct"]).reshape(4, 4)
        truth = T_us_ct_of(truth or folder / "truth.tfm")
        # By this the CT that was found lies off the true one, in coordinates of the CT.
        self.off = numpy.linalg.inv(truth) @ found
        self.tre_mm = numpy.linalg.norm(moved(self.off, self.points_ct) - self.points_ct, axis=1).mean()

    def centre_of(self, points_mm, shape):
        """The centre of points of the tumour in the image, without those under the text."""
        pixels = self.camera.project(points_mm)
        column, row = pixels.round().astype(int).T
        inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
        seen = ~is_text(shape)[row.clip(0, shape[0] - 1), column.clip(0, shape[1] - 1)] & inside
        return pixels[seen].mean(axis=0)

    def compare(self, index, drawn, raw, truth):
        """Measures of one image of the left camera: drawn and raw as rows x columns x 3, the truth a mask."""
        T_left_ct = numpy.linalg.inv(numpy.reshape(self.video["frames"][index]["T_ct_left"], (4, 4)))
        shift = numpy.array(self.video["frames"][index]["shift_ct_mm"])
        true_points = moved(T_left_ct, self.points_ct + shift)
        drawn_points = moved(T_left_ct, moved(self.off, self.points_ct))
        mm_per_px = true_points[:, 2].mean() / self.camera.focal.mean()
        tumour, band = regions(drawn, raw)
        truth = without_text(truth)
        drawn_outline, true_outline = free_outline(tumour), free_outline(truth)
        if not len(drawn_outline) or not len(true_outline):
            return {"in_view": False}
        apart = numpy.concatenate((nearest(drawn_outline, true_outline), nearest(true_outline, drawn_outline)))
        predicted = self.centre_of(drawn_points, truth.shape) - self.centre_of(true_points, truth.shape)
        measured = centre(tumour) - centre(truth)
        y, x = numpy.nonzero(band)
        covered = nearest(true_outline, numpy.column_stack((x, y)).astype(float)) <= TOUCHING_PX if len(x) else \
            numpy.zeros(len(true_outline), bool)
        return {"in_view": True, "mm_per_px": mm_per_px, "outline_px": apart.mean(),
                "outline_worst_px": apart.max(), "displacement_px": numpy.linalg.norm(measured),
                "predicted_px": numpy.linalg.norm(predicted),
                "unexplained_px": numpy.linalg.norm(measured - predicted), "within_band": covered.mean()}


def summary(case, measures):
    """Means over the images, and whether the band held the true outline in all of them."""
    seen = [m for m in measures if m["in_view"]]
    if not seen:
        sys.exit("the tumour was drawn into no image")
    means = {name: float(numpy.mean([m[name] for m in seen])) for name in seen[0] if name != "in_view"}
    return {"images": len(seen), "tre_at_tumour_mm": float(case.tre_mm),
            "outline_mm": means["outline_px"] * means["mm_per_px"],
            "displacement_mm": means["displacement_px"] * means["mm_per_px"],
            "predicted_mm": means["predicted_px"] * means["mm_per_px"],
            "least_within_band": float(min(m["within_band"] for m in seen)), **means}


def matched_images(times_s, record, shown):
    """Drawn and raw images, mask and index of the same stamps, in the order of time. The first mask to arrive must be
    that of the first time: this program is there before the video begins."""
    import rospy
    from sensor_msgs.msg import Image
    from us_ct_registration.msg import OverlayStatus
    topics = {"drawn": "/overlay_error/image", "raw": "/endoscope/left/image_raw",
              "truth": "/truth/endoscope/left/tumour", "shown": shown}
    received = {kind: {} for kind in [*topics, "status"]}

    def subscribe(kind, topic, message_type):
        return rospy.Subscriber(topic, message_type, lambda m: received[kind].update({m.header.stamp: m}),
                                queue_size=100, buff_size=2 ** 24)
    subscribers = [subscribe(kind, topic, Image) for kind, topic in topics.items()]
    subscribers.append(subscribe("status", "/overlay_error/status", OverlayStatus))
    needed = ("drawn", "raw", "truth", "status")
    end, newest, count = time.monotonic() + LIMIT_S, None, 0
    # The last images may have been dropped: the video has ended when nothing comes any more.
    while time.monotonic() < end and len(received["status"]) < len(times_s) and \
            (newest is None or time.monotonic() - newest < QUIET_S):
        time.sleep(0.05)
        if len(received["truth"]) > count:
            newest, count = time.monotonic(), len(received["truth"])
    time.sleep(0.5)
    for subscriber in subscribers:
        subscriber.unregister()
    if record:
        import rosbag
        with rosbag.Bag(str(record), "w") as bag:
            for stamp, image in sorted(received["shown"].items()):
                bag.write(topics["shown"], image, stamp)
    refused = [m.message for m in received["status"].values() if m.state == OverlayStatus.NOTHING]
    if refused:
        print(f"{len(refused)} images without overlay: {refused[-1]}")
    print("received: " + ", ".join(f"{len(messages)} {kind}" for kind, messages in received.items()))
    stamps = [stamp for stamp in sorted(received["drawn"]) if all(stamp in received[kind] for kind in needed) and
              received["status"][stamp].state != OverlayStatus.NOTHING]
    first = min(received["truth"], default=None)
    return [(*(array_of(received[kind][stamp]) for kind in ("drawn", "raw", "truth")),
             int(numpy.abs(numpy.array(times_s) - (stamp - first).to_sec()).argmin())) for stamp in stamps]


def array_of(image):
    pixels = numpy.frombuffer(image.data, numpy.uint8).reshape(image.height, image.width, -1)
    return pixels[..., 0] > 0 if image.encoding == "mono8" else pixels


def offset_of_video(path):
    """Seconds from the beginning of a bag to some time before its video, for rosbag play --start."""
    import rosbag
    with rosbag.Bag(path) as bag:
        for _, _, time_of_video in bag.read_messages("/endoscope/left/camera_info"):
            return time_of_video.to_sec() - bag.get_start_time() - BEFORE_VIDEO_S
    sys.exit(f"'{path}' has no video of an endoscope")


def play(options):
    """The player stands still until all who listen to it have connected: an image that is sent before reaches nobody."""
    arguments = ["--clock", "--quiet", "--pause", "--start", f"{offset_of_video(options.bag):.3f}"]
    if options.keep_alive:
        arguments.append("--keep-alive")
    else:
        arguments += ["--duration", str(options.duration)]
    player = subprocess.Popen(["rosbag", "play", *arguments, options.bag, f"__name:={PLAYER[1:]}"])
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _: player.send_signal(number))
    try:
        ros_graph.go_on(PLAYER, *options.listener)
    except (TimeoutError, subprocess.CalledProcessError) as error:
        player.terminate()
        sys.exit(f"{options.bag}: {error}")
    sys.exit(player.wait())


def measure(options):
    import rospy
    case = Case(options.case, options.result, options.truth)
    times_s = [frame["time_s"] for frame in case.video["frames"]]
    rospy.init_node("overlay_error", anonymous=True)
    images = matched_images(times_s, options.record, options.shown)
    if not images:
        sys.exit("the tumour was drawn into no image")
    measures = [case.compare(index, drawn, raw, truth) for drawn, raw, truth, index in images]
    result = summary(case, measures)
    if options.output:
        options.output.write_text(json.dumps(result, indent=1) + "\n")
    print(f"overlay error at the tumour: {result['outline_px']:.1f} px, {result['outline_mm']:.2f} mm "
          f"(between the outlines, mean of {result['images']} images)")
    print(f"  displacement {result['displacement_px']:.2f} px, {result['displacement_mm']:.2f} mm; the registration's "
          f"error at the tumour, {result['tre_at_tumour_mm']:.2f} mm in space, predicts "
          f"{result['predicted_px']:.2f} px; {result['unexplained_px']:.2f} px are not explained by it")
    print(f"  the uncertainty band holds {100 * result['within_band']:.1f} % of the true outline")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tasks = parser.add_subparsers(dest="task", required=True)
    task = tasks.add_parser("play", help="replays the video of a bag, once all who listen are connected")
    task.add_argument("bag")
    task.add_argument("--listener", action="append", default=[], help="a node to wait for, or how its name begins")
    end = task.add_mutually_exclusive_group(required=True)
    end.add_argument("--duration", type=float, help="s, of the bag's time")
    end.add_argument("--keep-alive", action="store_true", help="keeps the clock until it is ended")
    task.set_defaults(function=play)
    task = tasks.add_parser("measure", help="measures while the bag plays; to be started before the video begins")
    task.set_defaults(function=measure)
    task.add_argument("case", type=pathlib.Path, help="folder of usct phantom --endoscope, with segmentation.nrrd")
    task.add_argument("result", type=pathlib.Path, help="result of the registration, as demo_client.py writes it")
    task.add_argument("--truth", type=pathlib.Path,
                      help="truth in the frame of the result's ultrasound [CASE/truth.tfm]")
    task.add_argument("--output", type=pathlib.Path, help="measures as JSON")
    task.add_argument("--record", type=pathlib.Path, help="bag to write with the images that are shown")
    task.add_argument("--shown", default="/overlay/image", help="their topic [/overlay/image]")
    options = parser.parse_args()
    options.function(options)


if __name__ == "__main__":
    main()
