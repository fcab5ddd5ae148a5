"""The trunk of the perception network is what the package holds, layer for layer."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from cfnav_core.detect.heads import HEADS
from cfnav_core.files.checkpoint import CheckpointError
from cfnav_core.perception.trunk import DEVIATION, MEAN, Trunk
from studies.eyes.tfjs import weights
from studies.eyes.trunk import trunk_weights

NANODET = HEADS["nanodet"].given


def graph(**changed: np.ndarray) -> dict[str, np.ndarray]:
    """Constants as the package names them, small and random."""
    rng, found = np.random.default_rng(0), {}
    for i, layer in enumerate(Trunk().convolutions):
        outputs, inputs, height, width = layer.weight.shape
        kernel = rng.normal(size=(height, width, inputs, outputs)).astype(np.float16) / 16
        found["PartitionedCall/split" + (f"_{i}" if i else "")] = kernel
        found[f"unknown_{2 * i}"] = rng.normal(size=outputs).astype(np.float16)
    return found | changed


def convolved(x: np.ndarray, kernel: np.ndarray, bias: np.ndarray, stride: int) -> np.ndarray:
    """Of [H, W, inputs] with a border of zeros, and the leaky unit behind it."""
    padded = np.pad(x, ((1, 1), (1, 1), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), (0, 1))
    out = np.einsum("hwiab,abio->hwo", windows[::stride, ::stride], kernel.astype(float)) + bias
    return np.where(out > 0, out, 0.1 * out)


def test_a_picture_goes_through_as_through_nanodet():
    stored = graph()
    trunk = Trunk()
    trunk.load_state_dict({k: v.float() for k, v in trunk_weights(stored).items()})
    rgb = np.random.default_rng(1).integers(0, 256, (32, 48, 3))

    layers = iter(range(17))

    def layer(x: np.ndarray, stride: int = 1) -> np.ndarray:
        i = next(layers)
        kernel = stored["PartitionedCall/split" + (f"_{i}" if i else "")]
        return convolved(x, kernel, stored[f"unknown_{2 * i}"], stride)

    def stage(x: np.ndarray, blocks: int, stride: int) -> np.ndarray:
        first = x = layer(x, stride)
        for _ in range(blocks):
            narrow = layer(x)
            x = np.concatenate([layer(narrow), narrow], 2)
        return np.concatenate([layer(x), first], 2)

    x = layer(NANODET.values(rgb), 2)
    padded = np.pad(x, ((1, 1), (1, 1), (0, 0)), constant_values=-np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), (0, 1))
    fine = stage(stage(windows[::2, ::2].max((3, 4)), 1, 1), 2, 2)
    deep = stage(fine, 2, 2)
    with torch.no_grad():
        picture = torch.from_numpy(rgb / 255).permute(2, 0, 1)[None].float()
        found = [maps[0].permute(1, 2, 0).numpy() for maps in trunk(picture)]
    np.testing.assert_allclose(found[0], fine, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(found[1], deep, rtol=1e-3, atol=1e-3)


def test_colours_are_in_the_order_of_our_pictures():
    assert tuple(NANODET.mean[::-1]) == MEAN
    assert tuple(NANODET.deviation[::-1]) == DEVIATION


def test_another_network_is_refused():
    with pytest.raises(
        ValueError, match=r"found \(1, 1, 3, 32\) as convolution 0, expected \(3, 3"
    ):
        trunk_weights(graph(**{"PartitionedCall/split": np.zeros((1, 1, 3, 32))}))
    with pytest.raises(ValueError, match="found None as convolution 0"):
        trunk_weights({})


def test_constants_are_read_whatever_they_are_stored_as(tmp_path):
    halves, counts = np.arange(6, dtype=np.float16), np.array([7, 8], np.int32)
    entries = [
        {"name": "a", "shape": [2, 3], "dtype": "float32", "quantization": {"dtype": "float16"}},
        {"name": "b", "shape": [2], "dtype": "int32"},
    ]
    (tmp_path / "m.bin").write_bytes(halves.tobytes() + counts.tobytes())
    found = weights(tmp_path, [{"paths": ["m.bin"], "weights": entries}])
    np.testing.assert_array_equal(found["a"], halves.reshape(2, 3).astype(np.float32))
    np.testing.assert_array_equal(found["b"], counts)
    assert found["a"].dtype == np.float32


def test_what_ships_is_read_and_what_is_damaged_is_not(tmp_path):
    assert sum(weight.numel() for weight in Trunk.from_photographs().parameters()) == 672_224
    with pytest.raises(CheckpointError, match="found no readable checkpoint"):
        Trunk.from_photographs(tmp_path / "none.safetensors")


def test_training_keeps_the_first_layers_and_moves_the_others_slowly():
    trunk = Trunk()
    trunk.keep_first()
    moved = {name for name, weight in trunk.named_parameters() if weight.requires_grad}
    assert {name.split(".")[1] for name in moved} == {"1", "2"}
    assert not trunk.stem[0].weight.requires_grad
