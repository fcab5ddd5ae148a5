"""Pictures of every 8-bit encoding as RGB, against values worked out by hand and by Pillow."""

from __future__ import annotations

import io
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from cfnav_ros.robot.pictures import (
    ENCODINGS,
    LIVE,
    MAX_PIXELS,
    compressed_size,
    compressed_to_rgb,
    image_to_rgb,
)
from PIL import ExifTags, Image


def message(encoding, rows, width=None, height=None, step=None):
    """An Image with these rows of bytes."""
    rows = np.asarray(rows, np.uint8)
    pixel = ENCODINGS[encoding].pixel_bytes if encoding in ENCODINGS else 1
    return SimpleNamespace(
        encoding=encoding,
        height=len(rows) if height is None else height,
        width=rows.shape[1] // pixel if width is None else width,
        step=rows.shape[1] if step is None else step,
        data=rows.reshape(-1),
    )


def padded(rows, by=5):
    return np.pad(np.asarray(rows, np.uint8), ((0, 0), (0, by)), constant_values=77)


@pytest.mark.parametrize(
    ("encoding", "pixel", "rgb"),
    [
        ("rgb8", (1, 2, 3), (1, 2, 3)),
        ("bgr8", (1, 2, 3), (3, 2, 1)),
        ("rgba8", (1, 2, 3, 9), (1, 2, 3)),
        ("bgra8", (1, 2, 3, 9), (3, 2, 1)),
        ("8UC3", (1, 2, 3), (3, 2, 1)),
        ("8UC4", (1, 2, 3, 9), (3, 2, 1)),
        ("mono8", (7,), (7, 7, 7)),
        ("8UC1", (7,), (7, 7, 7)),
    ],
)
def test_channels_are_found(encoding, pixel, rgb):
    rows = np.tile(pixel, (3, 4))
    rows[0, : len(pixel)] = 0
    expected = np.tile(rgb, (3, 4, 1))
    expected[0, 0] = 0
    got = image_to_rgb(message(encoding, rows))
    assert got.dtype == np.uint8
    assert np.array_equal(got, expected)
    assert np.array_equal(image_to_rgb(message(encoding, padded(rows), width=4)), expected)
    assert np.array_equal(image_to_rgb(message(encoding, rows), 2), expected[::2, ::2])


# BT.601, luminance 16 to 235: black, white, red, green, blue as (Y, U, V), to the next integer.
COLOURS = {
    (16, 128, 128): (0, 0, 0),
    (235, 128, 128): (255, 255, 255),
    (81, 90, 240): (254, 0, 0),
    (145, 54, 34): (0, 255, 1),
    (41, 240, 110): (0, 0, 255),
    (126, 128, 128): (128, 128, 128),
}


@pytest.mark.parametrize(("yuv", "rgb"), COLOURS.items())
@pytest.mark.parametrize("encoding", ["yuv422", "yuv422_yuy2", "nv12", "nv21", "nv24"])
def test_yuv_is_bt601(encoding, yuv, rgb):
    y, u, v = yuv
    rows = {
        "yuv422": [[u, y, v, y, u, y, v, y]] * 2,
        "yuv422_yuy2": [[y, u, y, v, y, u, y, v]] * 2,
        "nv12": [[y] * 4, [y] * 4, [u, v, u, v]],
        "nv21": [[y] * 4, [y] * 4, [v, u, v, u]],
        "nv24": [[y] * 4, [y] * 4, *[[u, v, u, v]] * 4],
    }[encoding]
    got = image_to_rgb(message(encoding, rows, width=4, height=2)).astype(int)
    assert np.abs(got - rgb).max() <= 1
    assert got.shape == (2, 4, 3)


@pytest.mark.parametrize("encoding", ["yuv422", "yuv422_yuy2", "nv12", "nv21", "nv24"])
def test_yuv_is_within_one_level_of_the_exact_formula(encoding):
    """One level: OpenCV reckons in integers. To it luminance below 16 is black, as to cv_bridge."""
    yuv = np.random.default_rng(3).integers(0, 256, (3, 40, 60), np.uint8)
    y, u, v = yuv.repeat(2, axis=1).repeat(2, axis=2)  # 2x2 pixels of one colour
    by_turns = np.where(np.arange(120) % 2, v, u)
    rows = {
        "yuv422": np.stack([by_turns, y], axis=2).reshape(80, 240),
        "yuv422_yuy2": np.stack([y, by_turns], axis=2).reshape(80, 240),
        "nv12": np.concatenate([y, by_turns[::2]]),
        "nv21": np.concatenate([y, np.where(np.arange(120) % 2, u, v)[::2]]),
        "nv24": np.concatenate([y, np.stack([u, v], axis=2).reshape(160, 120)]),
    }[encoding]
    light, blue, red = 1.164383 * (np.maximum(y, 16) - 16.0), u - 128.0, v - 128.0
    green = light - 0.391762 * blue - 0.812968 * red
    exact = np.stack([light + 1.596027 * red, green, light + 2.017232 * blue], axis=2)
    got = image_to_rgb(message(encoding, rows, width=120, height=80))
    assert np.abs(got - exact.clip(0, 255)).max() <= 1


def test_luminance_and_colour_stay_at_their_pixels():
    rows = [[128, 16, 128, 126, 128, 235, 128, 16]]  # grey: 16, 126, 235, 16
    assert image_to_rgb(message("yuv422", rows))[0, :, 0].tolist() == [0, 128, 255, 0]
    rows = [[16, 128, 126, 128, 235, 128, 16, 128]]
    assert image_to_rgb(message("yuv422_yuy2", rows))[0, :, 0].tolist() == [0, 128, 255, 0]
    red, blue = (90, 240), (240, 110)
    rows = [[81] * 4, [81] * 4, [*red, *blue]]
    got = image_to_rgb(message("nv12", rows, height=2))
    assert (got[:, :2] == got[0, 0]).all()
    assert got[0, 0, 0] > 250 > got[0, 2, 0]
    assert got[0, 2, 2] == 255


@pytest.mark.parametrize(("encoding", "planes"), [("nv12", 1.5), ("nv24", 3.0)])
def test_a_step_that_counts_all_planes_or_padding_reads_the_same(encoding, planes):
    rng = np.random.default_rng(0)
    flat = rng.integers(0, 256, round(4 * 6 * planes), np.uint8)
    plain = message(encoding, flat.reshape(-1, 6), width=6, height=4)
    whole = SimpleNamespace(**{**vars(plain), "step": round(6 * planes)})
    assert np.array_equal(image_to_rgb(plain), image_to_rgb(whole))
    light, pairs = padded(flat[:24].reshape(4, 6), 2), flat[24:]
    pairs = padded(pairs.reshape(4, 12), 4) if planes == 3 else padded(pairs.reshape(2, 6), 2)
    data = np.concatenate([light.reshape(-1), pairs.reshape(-1)])
    wide = SimpleNamespace(**{**vars(plain), "step": 8, "data": data})
    assert np.array_equal(image_to_rgb(plain), image_to_rgb(wide))


PATTERNS = ("rggb", "bggr", "gbrg", "grbg")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_plain_colour_is_found_through_every_bayer_pattern(pattern):
    colour = {"r": 200, "g": 100, "b": 30}
    first, second = [[colour[c] for c in pair] for pair in (pattern[:2], pattern[2:])]
    rows = ([first * 3, second * 3] * 3)[:5]
    got = image_to_rgb(message(f"bayer_{pattern}8", rows))
    assert got.shape == (5, 6, 3)
    assert (got == (200, 100, 30)).all()


def test_bayer_is_interpolated_between_neighbours():
    rows = np.array(
        [
            [10, 20, 30, 40],
            [50, 60, 70, 80],
            [90, 100, 110, 120],
            [130, 140, 150, 160],
        ]
    )
    got = image_to_rgb(message("bayer_rggb8", rows))
    # (1, 1) is blue: green of the four beside it, red of the four at its corners.
    assert got[1, 1].tolist() == [(10 + 30 + 90 + 110) // 4, (20 + 50 + 70 + 100) // 4, 60]
    # (2, 2) is red, (1, 2) green between red above and below, blue left and right.
    assert got[2, 2].tolist() == [110, (70 + 100 + 120 + 150) // 4, (60 + 80 + 140 + 160) // 4]
    assert got[1, 2].tolist() == [(30 + 110) // 2, 70, (60 + 80) // 2]
    # At the edge the neighbours are mirrored.
    assert got[0, 0].tolist() == [10, (20 + 50) // 2, 60]
    assert got[3, 1].tolist() == [(90 + 110) // 2, (100 + 130 + 150 + 100) // 4, 140]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_can_leave_rows_and_columns_out(encoding):
    layout, (height, width) = ENCODINGS[encoding], (6, 8)
    size = round(height * layout.rows), width * layout.pixel_bytes
    rows = np.random.default_rng(1).integers(0, 256, size, np.uint8)
    picture = message(encoding, rows, width=width, height=height)
    whole = image_to_rgb(picture)
    assert whole.shape == (height, width, 3)
    assert np.array_equal(image_to_rgb(picture, 3), whole[::3, ::3])


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"encoding": "16UC1"}, "encoded as '16UC1', expected one of rgb8"),
        ({"height": 0}, "is 4x0, expected 1 to"),
        ({"height": 2**20, "width": 2**20}, f"expected 1 to {MAX_PIXELS}"),
        ({"step": 11}, "step is 11 bytes, expected at least 12"),
        ({"data": np.zeros(23, np.uint8)}, "holds 23 bytes, expected 24 for 2 rows of 12"),
        ({"encoding": "yuv422", "width": 3}, "is 3x2, expected even numbers for yuv422"),
        ({"encoding": "nv12", "height": 1}, "is 4x1, expected even numbers for nv12"),
        ({"encoding": "bayer_rggb8", "height": 1}, "expected at least 2x2"),
        ({"encoding": "nv12", "data": np.zeros(35, np.uint8)}, "holds 35 bytes, expected 36"),
    ],
)
def test_what_cannot_be_read_gives_one_sentence(fields, sentence):
    picture = message("rgb8", np.zeros((2, 12)))
    with pytest.raises(ValueError, match=sentence) as caught:
        image_to_rgb(SimpleNamespace(**{**vars(picture), **fields}))
    assert "\n" not in str(caught.value)


def test_the_live_node_takes_its_own_encodings_only():
    with pytest.raises(
        ValueError, match="'yuv422', expected one of rgb8, bgr8, rgba8, bgra8, mono8"
    ):
        image_to_rgb(message("yuv422", np.zeros((2, 8))), 1, LIVE)


def packed(rgb, kind, **how):
    out = io.BytesIO()
    Image.fromarray(rgb).save(out, kind, **how)
    return out.getvalue()


def compressed(data, said="rgb8; jpeg compressed bgr8"):
    return SimpleNamespace(format=said, data=np.frombuffer(data, np.uint8))


@pytest.fixture
def rgb():
    colours = np.zeros((16, 24, 3), np.uint8)
    colours[:, :12], colours[:, 12:] = (200, 40, 10), (10, 90, 220)
    return colours


def test_compressed_pictures_come_in_rgb(rgb):
    assert np.array_equal(compressed_to_rgb(compressed(packed(rgb, "PNG"), "png")), rgb)
    jpeg = compressed_to_rgb(compressed(packed(rgb, "JPEG", quality=95, subsampling=0), "jpeg"))
    assert np.abs(jpeg.astype(int) - rgb).max() < 12
    grey = compressed_to_rgb(compressed(packed(rgb[..., 0], "PNG"), "mono8; png compressed mono8"))
    assert np.array_equal(grey, np.repeat(rgb[..., :1], 3, axis=2))


def test_the_header_tells_the_size_and_part_of_a_picture_is_enough_to_look_at(rgb):
    for kind in ("PNG", "JPEG"):
        message = compressed(packed(rgb, kind))
        assert compressed_size(message) == rgb.shape[:2]
        assert np.array_equal(compressed_to_rgb(message, 3), compressed_to_rgb(message)[::3, ::3])


def test_a_picture_lies_as_its_camera_sent_it(rgb):
    turned = Image.Exif()
    turned[ExifTags.Base.Orientation] = 6
    sent = compressed_to_rgb(compressed(packed(rgb, "JPEG", exif=turned), "jpeg"))
    assert sent.shape == rgb.shape


def test_a_picture_that_was_compressed_red_first_is_turned_round(rgb):
    wrong = packed(np.ascontiguousarray(rgb[:, :, ::-1]), "PNG")
    got = compressed_to_rgb(compressed(wrong, "rgb8; png compressed rgb8"))
    assert np.array_equal(got, rgb)


def test_damaged_compressed_pictures_give_one_sentence(rgb):
    whole = packed(rgb, "JPEG")
    huge = Image.new("L", (6000, 4000))
    deep = Image.fromarray(np.zeros((4, 4), np.uint16))
    _, deep_colours = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint16))
    bad_sum = bytearray(packed(rgb, "PNG"))
    bad_sum[-17] ^= 1  # the last byte of the pixels' checksum
    for data, said, sentence in (
        (whole[: len(whole) // 2], "jpeg", "cannot be read: "),
        (b"", "jpeg", "begins with nothing, expected JPEG or PNG"),
        (b"GIF89a", "jpeg", "begins with 47 49 46 38"),
        (whole, "16UC1; compressedDepth", "expected JPEG or PNG"),
        (whole[:3] + bytes(100), "jpeg", "its header is damaged"),
        (bad_sum, "png", "it is damaged"),
        (_saved(huge), "png", "it is 6000x4000"),
        (_saved(deep), "png", "more than 8 bits"),
        (deep_colours, "png", "more than 8 bits"),
    ):
        with pytest.raises(ValueError, match=sentence) as caught:
            compressed_to_rgb(compressed(data, said))
        assert "\n" not in str(caught.value)


def _saved(picture):
    out = io.BytesIO()
    picture.save(out, "PNG")
    return out.getvalue()
