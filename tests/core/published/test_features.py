"""From AI2-THOR's pictures, by an encoder of the user's, to a store that can be trained on."""

from __future__ import annotations

import sys

import h5py
import numpy as np
import pytest
import torch
from PIL import Image
from torch import nn

from cfnav import cli
from cfnav_core.files.whole import WriteError
from cfnav_core.published import ai2thor
from cfnav_core.published.features import IMAGES, Encoder, add_features
from cfnav_core.published.keys import Key
from cfnav_core.scenes.scene import SceneError
from cfnav_core.scenes.store import open_store
from tests.core.disks import AGAIN, full_disk

from .test_ai2thor import Scripted

FILE = "resnet18_featuremap.hdf5"


def network(channels=512, side=14, stride=2):
    torch.manual_seed(0)
    return nn.Conv2d(3, channels, stride, stride).eval(), torch.zeros(1, 3, side, side)


def save(path, module, example):
    torch.onnx.export(module, example, str(path), dynamo=False)
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return save(tmp_path_factory.mktemp("encoder") / "encoder.onnx", *network())


@pytest.fixture
def exported(tmp_path):
    for name in ("FloorPlan1", "FloorPlan2"):
        ai2thor.export_scene(Scripted(), name, tmp_path / "scenes")
    return tmp_path / "scenes"


@pytest.fixture
def cfnav(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["cfnav", "data", *map(str, arguments)])
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        return code, *capsys.readouterr()

    return run


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_from_export_to_store(cfnav, exported, model, tmp_path):
    convert = ("convert", exported, "--out", tmp_path / "store", "--processes", 1)
    code, _, err = cfnav(*convert)
    assert code == 2
    assert "make features from its images.hdf5 with cfnav data features" in err
    code, out, _ = cfnav("features", exported, "--model", model)
    assert code == 0
    assert out.endswith(f"{FILE} in 2 scenes of {exported}\n")
    assert cfnav(*convert)[0] == 0
    scene = open_store(tmp_path / "store", ["FloorPlan1"])[0]
    convolution, _ = network()
    mean, deviation = np.array([[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]])
    with h5py.File(exported / "FloorPlan1" / IMAGES) as images:
        for state in (0, 17, scene.num_states - 1):
            picture = Image.fromarray(images[str(Key.of(scene, state))][()])
            picture = np.asarray(picture.resize((14, 14), Image.Resampling.BILINEAR)) / 255
            x = torch.tensor((picture - mean) / deviation).float().permute(2, 0, 1)
            with torch.no_grad():
                expected = convolution(x[None])[0].numpy()
            np.testing.assert_allclose(scene.features[state], expected, atol=2e-3)


def test_it_goes_on_where_it_stopped(cfnav, exported, model):
    with h5py.File(exported / "FloorPlan2" / IMAGES, "a") as images:
        key = list(images)[3]
        whole = images[key][()]
        del images[key]
        images[key] = whole[:, :, 0]
    code, _, err = cfnav("features", exported, "--model", model)
    assert code == 2
    assert f"found a picture uint8 (6, 6), expected uint8 [H, W, 3] (state {key} of" in err
    done = exported / "FloorPlan1" / FILE
    before = done.stat().st_mtime_ns
    assert not list((exported / "FloorPlan2").glob(FILE + "*"))
    with h5py.File(exported / "FloorPlan2" / IMAGES, "a") as images:
        del images[key]
        images[key] = whole
    assert cfnav("features", exported, "--model", model)[0] == 0
    assert (exported / "FloorPlan2" / FILE).exists()
    assert done.stat().st_mtime_ns == before


def test_a_full_disk_leaves_no_file_of_features(exported, model):
    with full_disk(300_000), pytest.raises(WriteError, match=AGAIN):
        add_features(exported / "FloorPlan1", Encoder(model))
    assert not list((exported / "FloorPlan1").glob(FILE + "*"))


def test_clips_maps_go_into_their_own_file(exported, tmp_path):
    encoder = Encoder(save(tmp_path / "clip.onnx", *network(channels=2048)))
    assert add_features(exported / "FloorPlan1", encoder) == 56
    with h5py.File(exported / "FloorPlan1" / "clip_featuremap.hdf5") as file:
        assert file["0.00|0.00|0|0"].shape == (2048, 7, 7)


def test_another_network_and_no_pictures_are_one_sentence(cfnav, exported, model, tmp_path):
    for options in ({"channels": 64}, {"side": 16}):
        with pytest.raises(SceneError, match="export the encoder without its last pooling"):
            Encoder(save(tmp_path / "other.onnx", *network(**options)))
    (tmp_path / "none.onnx").write_bytes(b"nothing")
    with pytest.raises(SceneError, match="found no usable encoder"):
        Encoder(tmp_path / "none.onnx")
    (exported / "FloorPlan1" / IMAGES).unlink()
    code, _, err = cfnav("features", exported, "--model", model)
    assert (code, "found no readable" in err) == (2, True)
