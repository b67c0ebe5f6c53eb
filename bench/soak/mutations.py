"""Messages that something has damaged. All damage can be noticed: a transform that is merely displaced could not."""
import copy
import io

import genpy
import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from us_ct_registration.msg import CtVolume, PreScanFrame, PreScanVolume, ProbeGeometry, RegistrationResult

NAN = float("nan")
# Far enough to be noticed: the nodes keep 60 s of tf, and clocks may disagree by 30 s.
FAR_S = (61.0, 100.0, 3600.0, 1e6, 1e9, 4294967295.0)


class RawFrame(PreScanFrame):
    """A frame that may be sent as other bytes than its own."""

    def serialize(self, buff):
        raw = getattr(self, "raw", None)
        if raw is None:
            super().serialize(buff)
        else:
            buff.write(raw)


def raw_frame(frame):
    message = RawFrame()
    for name in PreScanFrame.__slots__:
        setattr(message, name, getattr(frame, name))
    return message


def far_stamp(random, now):
    seconds = now.to_sec() + random.choice((-1.0, 1.0)) * random.choice(FAR_S)
    return rospy.Time.from_sec(min(max(0.0, seconds), 4294967295.0))


def flipped(random, frame):
    """A frame with a few wrong bits anywhere in its bytes but the first ones, which hold the stamp: a stamp that is
    slightly wrong is another pose, and nobody can tell. Lists that would end beyond the message are left out: roscpp
    itself makes room for them before it looks, for gigabytes."""
    buffer = io.BytesIO()
    PreScanFrame.serialize(frame, buffer)
    message = raw_frame(frame)
    while True:
        data = bytearray(buffer.getvalue())
        for _ in range(random.randint(1, 4)):
            # Mostly the header of the frame, not its many bytes of image.
            most = len(data) if random.random() < 0.2 else min(len(data), 700)
            data[random.randrange(12, most)] ^= 1 << random.randrange(8)
        try:
            PreScanFrame().deserialize(bytes(data))
        except (genpy.DeserializationError, UnicodeDecodeError):
            continue
        if random.random() < 0.2:
            del data[random.randrange(700, len(data)):]
        message.raw = bytes(data)
        return message


def damaged_frame(random, frame, now):
    message = raw_frame(frame)
    kind = random.randrange(7)
    if kind == 0:
        return flipped(random, message)
    if kind == 1:
        message.header.stamp = far_stamp(random, now)
    elif kind == 2:
        message.motor_angle = random.choice((NAN, float("inf"), 1e300, -1e300))
    elif kind == 3:
        message.samples = random.choice((0, 1, message.samples + 1, 2**31, 2**32 - 1))
    elif kind == 4:
        message.data = message.data[:random.randrange(len(message.data))]
    elif kind == 5:
        message.index = random.choice((message.index + 1000, 2**32 - 1))
    else:
        message.geometry = copy.deepcopy(message.geometry)
        message.geometry.probe_radius = random.choice((NAN, 0.0, -1.0, 1e9))
    return message


def damaged_tf(random, now, fixed, child):
    """A transform that tf, or the nodes, must not take."""
    stamped = TransformStamped(child_frame_id=child)
    stamped.header.frame_id, stamped.header.stamp = fixed, now
    stamped.transform.rotation.w = 1.0
    kind = random.randrange(4)
    if kind == 0:
        stamped.header.stamp = rospy.Time.from_sec(min(now.to_sec() + random.choice(FAR_S), 4294967295.0))
    elif kind == 1:
        stamped.transform.translation.x = NAN
    elif kind == 2:
        stamped.transform.rotation.w = random.choice((0.0, NAN, 5.0))
    else:
        stamped.child_frame_id = random.choice(("", fixed))
    return TFMessage([stamped])


def damaged_result(random, result):
    """A registration's result that must not be accepted, whatever the policy."""
    message = copy.deepcopy(result) if result is not None else RegistrationResult()
    message.id += 1
    kind = random.randrange(6)
    if kind == 0:
        message.fixed_transform.translation.x = random.choice((NAN, float("inf")))
    elif kind == 1:
        message.fixed_transform.rotation.w *= 2.0
    elif kind == 2:
        message.fixed_frame = random.choice(("", "/patient", "another_patient"))
    elif kind == 3:
        message.ct_crc32 = (message.ct_crc32 + 1) % 2**32
    elif kind == 4:
        message.ct_frame = random.choice(("", "/ct"))
    else:
        message.status.code = random.choice((0, 3, 4, 5, 200))
    return message


def damaged_volume(random, now):
    message = PreScanVolume(samples=2, lines=2, frames=2, frame_angles=[-0.1, 0.1], data=bytes(8), crc32=1)
    message.geometry = ProbeGeometry(type=random.choice((0, 1, 2, 3, 255)), probe_radius=random.choice((0.04, NAN)),
                                     motor_radius=0.027, sample_spacing=random.choice((0.001, 0.0, -1.0)),
                                     line_angles=[-0.1, 0.1])
    message.samples = random.choice((2, 0, 2**16, 2**32 - 1))
    message.header.stamp = random.choice((now, far_stamp(random, now)))
    message.header.frame_id = random.choice(("us", "", "/us", "nowhere"))
    return message


def damaged_ct(random, now):
    message = CtVolume(data=[0] * 8, crc32=1)
    message.size = [random.choice((2, 0, 2**31, 2**32 - 1)) for _ in range(3)]
    message.spacing = [random.choice((0.001, 0.0, NAN)) for _ in range(3)]
    message.header.stamp = random.choice((now, far_stamp(random, now)))
    message.header.frame_id = random.choice(("ct", ""))
    return message
