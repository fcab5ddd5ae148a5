"""Camera pictures as RGB: every 8-bit encoding of sensor_msgs/Image, and CompressedImage.

Pure. Colours are cv_bridge's: 8UC3 and 8UC4 are blue first, YUV is BT.601 with luminance from 16
to 235. ``LIVE`` is what the policy node takes; recorded pictures may have any of ``ENCODINGS``.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

MAX_PIXELS = 4096 * 4096
"""Larger pictures come from no camera of this robot."""

LIVE = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
"""Encodings that the policy node drives on."""


@dataclass(frozen=True)
class Encoding:
    """How the bytes of one encoding lie.

    Attributes:
        pixel_bytes: of a pixel in a row.
        rows: of the first plane's length that all planes have together, per row of the picture.
        even: width, and height of a picture with planes, must be even.
        convert: uint8 [rows, width * pixel_bytes], height, every -> uint8 [h, w, 3] RGB.
    """

    pixel_bytes: int
    convert: Callable[[np.ndarray, int, int], np.ndarray]
    rows: float = 1.0
    even: bool = False


def _channels(order: tuple[int, ...], rows: np.ndarray, height: int, every: int) -> np.ndarray:
    """Pick red, green and blue of pixels whose channels lie side by side."""
    pixel_bytes = 4 if len(order) == 4 else max(order) + 1
    pixels = rows.reshape(height, -1, pixel_bytes)[::every, ::every]
    return pixels[:, :, order[:3]]


def _yuv(y: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Convert by BT.601: uint8 [H, W] each -> uint8 [H, W, 3]."""
    light = 1.164383 * (y.astype(np.float32) - 16.0)
    blue, red = u.astype(np.float32) - 128.0, v.astype(np.float32) - 128.0
    rgb = np.stack(
        [
            light + 1.596027 * red,
            light - 0.391762 * blue - 0.812968 * red,
            light + 2.017232 * blue,
        ],
        axis=2,
    )
    return np.clip(np.rint(rgb), 0, 255).astype(np.uint8)


def _yuv422(order: str, rows: np.ndarray, height: int, every: int) -> np.ndarray:
    """Convert pairs of pixels, whose four bytes lie as ``order`` says; Y and Z are luminances."""
    quads = rows.reshape(height, -1, 4)
    at = {name: quads[:, :, order.index(name)] for name in "YUZV"}
    y = np.stack([at["Y"], at["Z"]], axis=2).reshape(height, -1)
    u, v = at["U"].repeat(2, axis=1), at["V"].repeat(2, axis=1)
    return _yuv(y[::every, ::every], u[::every, ::every], v[::every, ::every])


def _semi_planar(half: int, first: int, rows: np.ndarray, height: int, every: int) -> np.ndarray:
    """Convert luminance followed by pairs of U and V (``first`` 0) or V and U (1).

    ``half`` is how many pixels share a pair, along and across.
    """
    width = rows.shape[1]
    pairs = rows[height:].reshape(height // half, width // half, 2)
    u, v = (
        pairs[:, :, part].repeat(half, axis=0).repeat(half, axis=1)[::every, ::every]
        for part in (first, 1 - first)
    )
    return _yuv(rows[:height][::every, ::every], u, v)


_PATTERN_KERNELS = {
    "r": ((1, 2, 1), (2, 4, 2), (1, 2, 1)),
    "g": ((0, 1, 0), (1, 4, 1), (0, 1, 0)),
    "b": ((1, 2, 1), (2, 4, 2), (1, 2, 1)),
}
"""Weights of a colour's samples around a pixel, in quarters: bilinear interpolation."""


def _bayer(pattern: str, rows: np.ndarray, height: int, every: int) -> np.ndarray:
    """Interpolate a colour filter array; ``pattern`` names its first two rows, as in "rggb"."""
    padded = np.pad(rows.astype(np.uint16), 1, mode="reflect")  # keeps the pattern in step
    width = rows.shape[1]
    down, along = np.indices(padded.shape) % 2
    colours = []
    for colour, kernel in _PATTERN_KERNELS.items():
        here = np.zeros(padded.shape, bool)
        for place, name in enumerate(pattern):
            # The padding moves the pattern by one, so that its first pixel is odd in both ways.
            if name == colour:
                here |= (down != place // 2) & (along != place % 2)
        samples = np.where(here, padded, 0)
        total: np.ndarray = np.add.reduce(
            [
                weight * samples[y : y + height, x : x + width]
                for y, line in enumerate(kernel)
                for x, weight in enumerate(line)
            ]
        )
        colours.append(((total + 2) // 4).astype(np.uint8))
    return np.stack(colours, axis=2)[::every, ::every]


_RGB, _BGR, _RGBA, _BGRA, _GREY = (0, 1, 2), (2, 1, 0), (0, 1, 2, 3), (2, 1, 0, 3), (0, 0, 0)

ENCODINGS = {
    "rgb8": Encoding(3, partial(_channels, _RGB)),
    "bgr8": Encoding(3, partial(_channels, _BGR)),
    "rgba8": Encoding(4, partial(_channels, _RGBA)),
    "bgra8": Encoding(4, partial(_channels, _BGRA)),
    "mono8": Encoding(1, partial(_channels, _GREY)),
    "8UC1": Encoding(1, partial(_channels, _GREY)),
    "8UC3": Encoding(3, partial(_channels, _BGR)),
    "8UC4": Encoding(4, partial(_channels, _BGRA)),
    "bayer_rggb8": Encoding(1, partial(_bayer, "rggb")),
    "bayer_bggr8": Encoding(1, partial(_bayer, "bggr")),
    "bayer_gbrg8": Encoding(1, partial(_bayer, "gbrg")),
    "bayer_grbg8": Encoding(1, partial(_bayer, "grbg")),
    "yuv422": Encoding(2, partial(_yuv422, "UYVZ"), even=True),
    "uyvy": Encoding(2, partial(_yuv422, "UYVZ"), even=True),
    "yuv422_yuy2": Encoding(2, partial(_yuv422, "YUZV"), even=True),
    "yuyv": Encoding(2, partial(_yuv422, "YUZV"), even=True),
    "nv12": Encoding(1, partial(_semi_planar, 2, 0), rows=1.5, even=True),
    "nv21": Encoding(1, partial(_semi_planar, 2, 1), rows=1.5, even=True),
    "nv24": Encoding(1, partial(_semi_planar, 1, 0), rows=3.0),
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
        every: rows and columns that are left out make it cheaper; 1 takes all.
        encodings: those that are taken.

    Returns:
        uint8 [H, W, 3] RGB, a copy; H and W divided by ``every``, rounded up.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    check(message, encodings)
    layout, stride = ENCODINGS[message.encoding], _stride(message)
    rows = round(message.height * layout.rows)
    data = np.asarray(message.data, np.uint8)[: stride * rows]
    table = data.reshape(rows, stride)
    if layout.rows == 3.0:  # nv24: a row of pairs is as long as two of luminance
        table = _pairs_in_line(data, message.height, message.width, stride)
    return layout.convert(table[:, : message.width * layout.pixel_bytes], message.height, every)


def _pairs_in_line(data: np.ndarray, height: int, width: int, stride: int) -> np.ndarray:
    """Rows of luminance, then every row of pairs as two rows of the same length."""
    light = data[: height * stride].reshape(height, stride)[:, :width]
    pairs = data[height * stride :].reshape(height, 2 * stride)[:, : 2 * width]
    return np.concatenate([light, pairs.reshape(2 * height, width)])


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


def compressed_to_rgb(message: Any) -> np.ndarray:
    """Decode a JPEG or PNG.

    Args:
        message: with the fields of sensor_msgs/CompressedImage.

    Returns:
        uint8 [H, W, 3] RGB.

    Raises:
        ValueError: it is neither, too large, damaged or deeper than 8 bits; one sentence.
    """
    check_compressed(message)
    try:
        with Image.open(io.BytesIO(message.data), formats=("JPEG", "PNG")) as picture:
            if not 0 < picture.width * picture.height <= MAX_PIXELS:
                raise ValueError(f"it is {picture.width}x{picture.height}")
            if picture.mode.startswith(("I", "F")):
                raise ValueError("it has more than 8 bits a colour")
            rgb = np.array(picture.convert("RGB"))
    except Exception as error:  # a damaged file fails anywhere in the decoder, in any way
        raise ValueError(f"The compressed picture cannot be read: {error}.") from error
    # image_transport compresses by OpenCV, which takes the first channel for blue.
    swapped = "compressed rgb" in message.format
    return np.ascontiguousarray(rgb[:, :, ::-1]) if swapped else rgb
