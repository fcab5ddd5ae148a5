"""How boxes are judged, and maps for a network that was exported without."""

from __future__ import annotations

import numpy as np
import pytest

from cfnav_core.perception.perception import OnnxPerception
from studies.eyes.boxes import View, fit, give_maps
from tests.core.model_samples import older_perception
from tests.core.perception.made import colour_maps
from tests.studies.eyes.made import colour_perception


def test_boxes_are_judged_by_the_thing_that_they_fit_best(tmp_path):
    network = OnnxPerception(colour_maps(tmp_path / "colours.onnx"))
    shown = np.zeros((2, 3, 4), np.float32)
    shown[0, 1, 1] = shown[1, 0, 0] = shown[1, 2, 3] = 1.0
    # on pictures of the mast's 300 pixels: cells of 8 of 32 across, of 8 of 24 down
    box = (1.2 * 75, 1.2 * 100, 1.8 * 75, 1.8 * 100)
    most = (*box[:2], 0.2 * box[0] + 0.8 * box[2], box[3])
    things = ("Apple", most, True), ("Apple", (0.0, 0.0, 9.0, 9.0), True), ("Pen", box, True)
    found = fit([View(shown, things)], network, 0.7, True)
    assert found.mean_iou == pytest.approx(0.8)  # that of the Apple; there is no Mug to fit
    assert (found.boxes, found.things, found.pairs) == (3, 2, 1)
    assert (found.right, found.found) == (pytest.approx(1 / 3), 0.5)
    small = fit([View(shown, (("Apple", box, False),))], network, 0.7, True)
    assert (small.mean_iou, small.things, small.pairs) == (pytest.approx(1.0), 0, 0)


def test_a_network_without_maps_is_given_its_own(tmp_path):
    rgb = np.random.default_rng(0).integers(0, 256, (300, 300, 3), np.uint8)
    give_maps(older_perception(), tmp_path / "with.onnx")
    before, after = OnnxPerception(older_perception()), OnnxPerception(tmp_path / "with.onnx")
    np.testing.assert_array_equal(before.observe(rgb).features, after.observe(rgb).features)
    best = after.maps(rgb).max((1, 2))
    np.testing.assert_allclose(before.observe(rgb).detections[0, :, 0], best, atol=1e-3)
    with pytest.raises(ValueError, match="expected a network of cfnav perception"):
        give_maps(colour_perception(tmp_path / "other.onnx"), tmp_path / "none.onnx")
