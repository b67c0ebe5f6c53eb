"""The pictures of an H.264 file, by the libraries that OpenCV reads videos with."""
import ctypes
import ctypes.util

import numpy

H264 = 27  # AV_CODEC_ID_H264
PADDING = 64  # bytes that a parser may read beyond the end
POINTER = ctypes.c_void_p


class Packet(ctypes.Structure):
    """The beginning of AVPacket."""

    _fields_ = [("buffer", POINTER), ("pts", ctypes.c_int64), ("dts", ctypes.c_int64), ("data", POINTER),
                ("size", ctypes.c_int)]


class Frame(ctypes.Structure):
    """The beginning of AVFrame."""

    _fields_ = [("data", POINTER * 8), ("linesize", ctypes.c_int * 8), ("extended_data", POINTER),
                ("width", ctypes.c_int), ("height", ctypes.c_int)]


class Decoder:
    """Pictures come in the order of display."""

    def __init__(self):
        names = [ctypes.util.find_library(name) for name in ("avcodec", "avutil")]
        if None in names:
            raise OSError("libavcodec and libavutil are not there")
        self.codec, util = map(ctypes.CDLL, names)
        self.context = self.made(self.codec.avcodec_alloc_context3,
                                 self.made(self.codec.avcodec_find_decoder, H264))
        self.parser = self.made(self.codec.av_parser_init, H264)
        self.packet = self.made(self.codec.av_packet_alloc)
        self.frame = self.made(util.av_frame_alloc)
        self.check(self.codec.avcodec_open2(self.context, None, None))
        self.pictures = []

    @staticmethod
    def made(function, *arguments):
        function.restype = POINTER
        pointer = function(*arguments)
        if pointer is None:
            raise OSError(f"{function.__name__} fails")
        return POINTER(pointer)

    @staticmethod
    def check(error):
        if error != 0:
            raise OSError(f"the decoder fails: {error}")

    def send(self, packet):
        self.check(self.codec.avcodec_send_packet(self.context, packet))
        frame = ctypes.cast(self.frame, ctypes.POINTER(Frame)).contents
        while self.codec.avcodec_receive_frame(self.context, self.frame) == 0:
            # The first plane is the brightness.
            rows = ctypes.cast(frame.data[0], ctypes.POINTER(ctypes.c_uint8))
            self.pictures.append(
                numpy.ctypeslib.as_array(rows, (frame.height, frame.linesize[0]))[:, :frame.width].copy())

    def decode(self, stream):
        buffer = ctypes.create_string_buffer(stream + bytes(PADDING))
        packet = ctypes.cast(self.packet, ctypes.POINTER(Packet)).contents
        data, size, at, zero = POINTER(), ctypes.c_int(), 0, ctypes.c_int64(0)
        # Without any input the parser returns its remaining data.
        left = True
        while left or size.value > 0:
            left = at < len(stream)
            at += self.codec.av_parser_parse2(self.parser, self.context, ctypes.byref(data), ctypes.byref(size),
                                              POINTER(ctypes.addressof(buffer) + at), len(stream) - at, zero, zero,
                                              zero)
            if size.value > 0:
                packet.data, packet.size = data.value, size.value
                self.send(self.packet)
        self.send(None)
        return numpy.array(self.pictures)


def pictures_of(path):
    """Brightness, pictures x rows x columns; OSError without the libraries."""
    return Decoder().decode(path.read_bytes())
