"""What can be wrong with an Image or CompressedImage message; each function changes one in place.

A compressed picture is what image_transport makes of the raw one with the same fault; where that
has no rows whose layout can be broken, its bytes are broken. The rows that use them are in
``faults.FAULTS``. Knows no ROS: messages are taken as they come.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from sim_bridge.robot.packing import pack, unpack

PADDING = 28
"""Bytes after the pixels of a row."""

HUGE = (2160, 3840)
"""Rows and columns of a 4K picture."""

DEPTH_PER_GREY = 20
"""mm that a grey level becomes in a depth picture."""

NEAR_MM, NEAR_NOISE_MM = 100.0, 2.0
"""Depth of a hand before the lens, less than a MoveAhead has left when it is told in time; pictures
that did not vary would be frozen."""


def packed(image: Any) -> bool:
    """Whether a message is a CompressedImage."""
    return hasattr(image, "format")


def set_picture(image: Any, encoding: str, pixels: np.ndarray) -> None:
    """Write rows of pixels.

    Args:
        image: the message.
        encoding: as in sensor_msgs.
        pixels: [H, W] or [H, W, C], any type of number.
    """
    if packed(image):
        if pixels.dtype == np.uint8:
            pixels = BLUE_FIRST[encoding](np.atleast_3d(pixels))
        image.format, data = pack(pixels, encoding)
        image.data = array("B", data)
        return
    image.encoding = encoding
    image.height, image.width = pixels.shape[:2]
    image.step = pixels[:1].nbytes
    image.data = array("B", np.ascontiguousarray(pixels).tobytes())


BLUE_FIRST: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "bgr8": lambda pixels: pixels,
    "rgb8": lambda pixels: pixels[..., ::-1],
    "bgra8": lambda pixels: pixels[..., :3],
    "mono8": lambda pixels: pixels.repeat(3, axis=2),
    "yuv422": lambda pixels: pixels[..., 1:].repeat(3, axis=2),
    "16UC1": lambda pixels: (
        (pixels.view(np.uint16) // DEPTH_PER_GREY).astype(np.uint8).repeat(3, 2)
    ),
}
"""uint8 [H, W, bytes of a pixel] -> [H, W, 3], for every encoding that a fault leaves behind."""


def pixels_of(image: Any) -> np.ndarray:
    """uint8 [H, W, 3], blue first, of a picture without padding, whatever its encoding."""
    if packed(image):
        return unpack(image.data)
    pixels = np.array(image.data, np.uint8).reshape(image.height, image.width, -1)
    return BLUE_FIRST[image.encoding](pixels)


def grey(image: Any) -> np.ndarray:
    """uint8 [H, W]: luminance."""
    return (pixels_of(image) @ np.array([0.114, 0.587, 0.299])).astype(np.uint8)


def filled(value: int) -> Callable[[Any], None]:
    """Every pixel the same."""
    return lambda image: set_picture(image, "bgr8", np.full_like(pixels_of(image), value))


def mono8(image: Any) -> None:
    """The same picture without colours."""
    set_picture(image, "mono8", grey(image))


def bgra8(image: Any) -> None:
    """The same picture with a fourth channel."""
    pixels = pixels_of(image)
    opaque = np.full_like(pixels[..., :1], 255)
    set_picture(image, "bgra8", np.concatenate([pixels, opaque], axis=2))


def rgb8(image: Any) -> None:
    """The same picture, red first."""
    set_picture(image, "rgb8", pixels_of(image)[..., ::-1])


def yuv422(image: Any) -> None:
    """Two bytes a pixel, colour and luminance: the same picture without colours."""
    luminance = grey(image)
    set_picture(image, "yuv422", np.stack([np.full_like(luminance, 128), luminance], axis=2))


def depth16(image: Any) -> None:
    """A depth picture where colours are expected."""
    set_picture(image, "16UC1", grey(image).astype(np.uint16) * DEPTH_PER_GREY)


def padded(image: Any) -> None:
    """Rows longer than their pixels, which is allowed; compressed they are the same."""
    if packed(image):
        return
    rows = np.array(image.data, np.uint8).reshape(image.height, -1)
    step = rows.shape[1] + PADDING
    image.data = array("B", np.pad(rows, ((0, 0), (0, PADDING)), constant_values=255).tobytes())
    image.step = step


def step_short(image: Any) -> None:
    """A step that cannot hold a row's pixels; of a compressed picture a header without a size."""
    if packed(image):
        image.data = image.data[:2] + array("B", bytes(len(image.data) - 2))
        return
    image.step //= 2


def data_short(image: Any) -> None:
    """Half of the data is missing."""
    image.data = image.data[: len(image.data) // 2]


def empty(image: Any) -> None:
    """A picture of no pixels."""
    set_picture(image, "bgr8", np.zeros((0, 0, 3), np.uint8))


def huge(image: Any) -> None:
    """The same picture in 4K."""
    pixels = pixels_of(image)
    rows, columns = (
        np.arange(size) * shown // size for size, shown in zip(HUGE, pixels.shape[:2], strict=True)
    )
    set_picture(image, "bgr8", pixels[rows][:, columns])


def all_zero(image: Any) -> None:
    """A depth picture that measures nothing: the lens is covered."""
    set_picture(image, "16UC1", np.zeros((image.height, image.width), np.uint16))


def all_near(rng: np.random.Generator) -> Callable[[Any], None]:
    """Depth pictures that measure something right before the lens at every pixel."""

    def change(image: Any) -> None:
        near = rng.normal(NEAR_MM, NEAR_NOISE_MM, (image.height, image.width))
        set_picture(image, "16UC1", np.rint(near).astype(np.uint16))

    return change


SHAPES: dict[str, Callable[[Any], None]] = {
    "image_black": filled(0),
    "image_white": filled(255),
    "image_huge": huge,
    "image_mono8": mono8,
    "image_bgra8": bgra8,
    "image_rgb8": rgb8,
    "image_yuv422": yuv422,
    "image_16uc1": depth16,
    "image_padded": padded,
    "image_step_short": step_short,
    "image_data_short": data_short,
    "image_empty": empty,
}
"""Faults that change every picture the same way. Of several that hold, each takes what those before
it in the table have made, so what breaks the layout of the bytes comes after what needs it."""

DEPTH_SHAPES: dict[str, Callable[[Any], None]] = {
    "depth_all_zero": all_zero,
    "depth_rgb8": rgb8,
    "depth_data_short": data_short,
}
"""The same of depth pictures."""
