"""Pictures as image_transport's plugin ``compressed`` sends them, by OpenCV. Knows no ROS.

Source: compressed_image_transport (jazzy), with its default quality.
"""

from __future__ import annotations

import cv2
import numpy as np

JPEG_QUALITY = 95


def pack(pixels: np.ndarray, encoding: str) -> tuple[str, bytes]:
    """Compress a picture: JPEG, or PNG where that cannot hold it.

    Args:
        pixels: uint8 [H, W, 3], blue first, or uint16 [H, W].
        encoding: of the raw picture, as in sensor_msgs.

    Returns:
        What the message says of its format, and its bytes; none of an empty picture.
    """
    deep = pixels.dtype != np.uint8
    kind, packed = ("png", encoding) if deep else ("jpeg", "bgr8")
    said = f"{encoding}; {kind} compressed {packed}"
    if not pixels.size:
        return said, b""
    _, data = cv2.imencode(f".{kind}", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return said, data.tobytes()


def unpack(data: bytes) -> np.ndarray:
    """The picture in a whole JPEG or PNG: uint8 [H, W, 3], blue first."""
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_BGR)
    assert pixels is not None
    return pixels
