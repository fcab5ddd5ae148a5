"""Camera pictures as RGB: every 8-bit encoding of sensor_msgs/Image, and CompressedImage.

Pure. OpenCV converts, so colours are cv_bridge's: 8UC3 and 8UC4 are blue first, YUV is BT.601 with
luminance from 16 to 235. ``LIVE`` is what the policy node takes raw; recorded pictures may have any
of ``ENCODINGS``. Of compressed ones both take JPEG and PNG.
"""

from __future__ import annotations

import io
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from PIL import Image

MAX_PIXELS = 4096 * 4096
"""Larger pictures come from no camera of this robot."""

LIVE = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
"""Encodings that the policy node drives on."""


@dataclass(frozen=True)
class Encoding:
    """How the bytes of one encoding lie, and what OpenCV calls their conversion.

    Attributes:
        pixel_bytes: of a pixel in a row.
        code: of ``cv2.cvtColor``; None where the pixels are RGB already.
        even: width, and height of a picture with two planes, must be even.
        share: pixels along, and across, that share a pair of U and V of a second plane; 0 without.
    """

    pixel_bytes: int
    code: int | None
    even: bool = False
    share: int = 0

    @property
    def rows(self) -> float:
        """Of the first plane's length that all planes have together, per row of the picture."""
        return 1.0 + 2.0 / self.share**2 if self.share else 1.0


# OpenCV has two names for each Bayer pattern. The four-letter ones name the first two rows, as ROS
# does; BayerBG and the like begin at the second pixel of the second row.
ENCODINGS = {
    "rgb8": Encoding(3, None),
    "bgr8": Encoding(3, cv2.COLOR_BGR2RGB),
    "rgba8": Encoding(4, cv2.COLOR_RGBA2RGB),
    "bgra8": Encoding(4, cv2.COLOR_BGRA2RGB),
    "mono8": Encoding(1, cv2.COLOR_GRAY2RGB),
    "8UC1": Encoding(1, cv2.COLOR_GRAY2RGB),
    "8UC3": Encoding(3, cv2.COLOR_BGR2RGB),
    "8UC4": Encoding(4, cv2.COLOR_BGRA2RGB),
    "bayer_rggb8": Encoding(1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": Encoding(1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": Encoding(1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": Encoding(1, cv2.COLOR_BayerGRBG2RGB),
    "yuv422": Encoding(2, cv2.COLOR_YUV2RGB_UYVY, even=True),
    "uyvy": Encoding(2, cv2.COLOR_YUV2RGB_UYVY, even=True),
    "yuv422_yuy2": Encoding(2, cv2.COLOR_YUV2RGB_YUY2, even=True),
    "yuyv": Encoding(2, cv2.COLOR_YUV2RGB_YUY2, even=True),
    "nv12": Encoding(1, cv2.COLOR_YUV2RGB_NV12, even=True, share=2),
    "nv21": Encoding(1, cv2.COLOR_YUV2RGB_NV21, even=True, share=2),
    "nv24": Encoding(1, cv2.COLOR_YUV2RGB_NV12, share=1),
}
"""Every 8-bit encoding of sensor_msgs, and what depthai and v4l2 drivers call theirs."""


def check(message: Any, encodings: Collection[str] = tuple(ENCODINGS)) -> None:
    """Check the fields of a sensor_msgs/Image without touching its pixels.

    Args:
        message: with the fields of sensor_msgs/Image.
        encodings: those that are taken.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    height, width, encoding = message.height, message.width, message.encoding
    if encoding not in encodings:
        raise ValueError(
            f"The picture is encoded as {encoding!r}, expected one of {', '.join(encodings)}: "
            "set the camera driver to one of them."
        )
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"The picture is {width}x{height}, expected 1 to {MAX_PIXELS} pixels.")
    layout = ENCODINGS[encoding]
    if layout.even and (width % 2 or (layout.rows != 1.0 and height % 2)):
        raise ValueError(
            f"The picture is {width}x{height}, expected even numbers for {encoding}, whose pixels "
            "share their colours."
        )
    if encoding.startswith("bayer") and min(height, width) < 2:
        raise ValueError(f"The picture is {width}x{height}, expected at least 2x2 for {encoding}.")
    row = width * layout.pixel_bytes
    if message.step < row:
        raise ValueError(
            f"The picture's step is {message.step} bytes, expected at least {row} for {width} "
            f"pixels of {encoding}."
        )
    rows, held = round(height * layout.rows), len(message.data)
    if held < _stride(message) * rows:
        raise ValueError(
            f"The picture holds {held} bytes, expected {message.step * rows} for {rows} "
            f"rows of {message.step}."
        )


def _stride(message: Any) -> int:
    """Bytes from one row to the next; some drivers count all planes into the step."""
    layout = ENCODINGS[message.encoding]
    if layout.rows != 1.0 and message.step == round(message.width * layout.rows):
        return message.width
    return message.step


def image_to_rgb(
    message: Any, every: int = 1, encodings: Collection[str] = tuple(ENCODINGS)
) -> np.ndarray:
    """Decode a picture.

    Args:
        message: 8-bit, with the fields of sensor_msgs/Image; rows may be padded (``step``).
            ``is_bigendian`` has no meaning for 8 bits and is set at will by drivers.
        every: of so many rows, and of so many columns, the first is taken; 1 takes all.
        encodings: those that are taken.

    Returns:
        uint8 [H, W, 3] RGB, a copy; H and W divided by ``every``, rounded up.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    check(message, encodings)
    layout, stride = ENCODINGS[message.encoding], _stride(message)
    height, width, code = message.height, message.width, layout.code
    data = np.asarray(message.data, np.uint8)[: stride * round(height * layout.rows)]
    plane, pairs = np.split(data, [stride * height])
    rows = plane.reshape(height, stride)[:, : width * layout.pixel_bytes]
    pixels = rows.reshape(height, width, layout.pixel_bytes)
    rgb: np.ndarray
    if code is None:
        rgb = pixels.copy()
    elif layout.share:
        rgb = _two_planes(code, rows, pairs, layout.share)
    elif message.encoding.startswith("bayer"):
        rgb = _bayer(code, rows)
    else:
        rgb = cv2.cvtColor(pixels, code)
    return rgb[::every, ::every]


def _bayer(code: int, rows: np.ndarray) -> np.ndarray:
    """Interpolate a colour filter array, uint8 [H, W].

    OpenCV does not interpolate at the edge but copies the neighbours. Two mirrored pixels, which
    keep the pattern in step, move that edge out of the picture.
    """
    padded = cv2.copyMakeBorder(rows, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    return cv2.cvtColor(padded, code)[2:-2, 2:-2]


def _two_planes(code: int, light: np.ndarray, pairs: np.ndarray, share: int) -> np.ndarray:
    """Convert luminance, uint8 [H, W], and the bytes of a plane of pairs of U and V.

    OpenCV knows only pairs that 2x2 pixels share: where each pixel has its own, it becomes 2x2.
    """
    height, width = light.shape[0] // share, light.shape[1] // share
    colours = pairs.reshape(height, -1)[:, : 2 * width].reshape(height, width, 2)
    grown = 2 // share
    light = light.repeat(grown, axis=0).repeat(grown, axis=1)
    return cv2.cvtColorTwoPlane(light, colours, code)[::grown, ::grown]


def check_compressed(message: Any) -> None:
    """Check what can be told of a sensor_msgs/CompressedImage without opening it.

    Raises:
        ValueError: it is no JPEG and no PNG; one sentence.
    """
    start = bytes(message.data[:4])
    if "compressedDepth" in message.format or not start.startswith((b"\xff\xd8", b"\x89PNG")):
        raise ValueError(
            f"The compressed picture has the format {message.format!r} and begins with "
            f"{start.hex(' ') or 'nothing'}, expected JPEG or PNG."
        )


def compressed_size(message: Any) -> tuple[int, int]:
    """Height and width of a JPEG or PNG by its header, pixels.

    Args:
        message: with the fields of sensor_msgs/CompressedImage.

    Raises:
        ValueError: it is neither, too large, or its header is damaged; one sentence.
    """
    check_compressed(message)
    try:
        # Pillow reads the header: OpenCV tells a picture's size only after decoding all of it.
        with Image.open(io.BytesIO(message.data), formats=("JPEG", "PNG")) as header:
            width, height = header.size
    except Exception as error:  # a damaged header fails in any way
        raise ValueError("The compressed picture cannot be read: its header is damaged.") from error
    if not 0 < width * height <= MAX_PIXELS:
        raise ValueError(f"The compressed picture cannot be read: it is {width}x{height}.")
    return height, width


def compressed_to_rgb(message: Any, every: int = 1) -> np.ndarray:
    """Decode a JPEG or PNG.

    Args:
        message: with the fields of sensor_msgs/CompressedImage.
        every: as for ``image_to_rgb``; all is decoded in any case.

    Returns:
        uint8 [H, W, 3] RGB; H and W divided by ``every``, rounded up.

    Raises:
        ValueError: it is neither, too large, damaged or deeper than 8 bits; one sentence.
    """
    compressed_size(message)
    # image_transport compresses by OpenCV, which takes the first channel for blue.
    order = cv2.IMREAD_COLOR_BGR if "compressed rgb" in message.format else cv2.IMREAD_COLOR_RGB
    try:
        data = np.frombuffer(message.data, np.uint8)
        rgb = cv2.imdecode(data, order | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)
        if rgb is None:
            raise ValueError("it is damaged")
        if rgb.dtype != np.uint8:
            raise ValueError("it has more than 8 bits a colour")
    except Exception as error:  # a damaged file fails anywhere in the decoder, in any way
        raise ValueError(f"The compressed picture cannot be read: {error}.") from error
    return rgb[::every, ::every]
