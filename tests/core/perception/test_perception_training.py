"""Training perception among sets that come while it runs, and what it then says."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from cfnav_core.files.checkpoint import SUPERVISED, CheckpointError, load_tensors, save_state
from cfnav_core.files.locks import locked
from cfnav_core.perception.augment import Labelled, augment
from cfnav_core.perception.half import LEAST
from cfnav_core.perception.net import PerceptionNet, export_perception, perception_loss
from cfnav_core.perception.perception import AT_ONCE, OnnxPerception
from cfnav_core.perception.shelf import Shelf
from cfnav_core.perception.sight import Sight
from cfnav_core.perception.train import PerceptionOptions, begin_with, train
from cfnav_core.task.camera import CAMERAS
from cfnav_core.task.detections import SCORES
from tests.core.perception.made import SMALL, picture_set


@pytest.fixture
def options(tmp_path):
    for seed in (1000, 1001, 1002, 1019):
        picture_set(tmp_path / "sets", seed)
    return PerceptionOptions(
        tmp_path / "sets", tmp_path / "perception.onnx", pictures=640, batch=32, threads=1
    )


@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_the_network_has_the_sizes_of_its_camera(name, tmp_path):
    camera = CAMERAS[name]
    sight = Sight.of(camera)
    net = PerceptionNet(sight=sight)
    shown, near, features, geometry = net.eval()(torch.zeros(1, 3, *sight.picture))
    assert shown.shape[2:] == near.shape[2:] == sight.heat
    assert geometry.shape[2:] == sight.coarse
    export_perception(net, tmp_path / "p.onnx", camera=camera)
    perception = OnnxPerception(tmp_path / "p.onnx")
    assert (perception.gives.size, perception.gives.camera) == (sight.picture, camera)
    width, height = camera.size
    seen = perception.observe(np.zeros((height, width, 3), np.uint8))
    assert seen.features.shape[-1] == features.shape[1]
    maps = perception.maps(np.zeros((height, width, 3), np.uint8))
    np.testing.assert_allclose(maps, torch.sigmoid(shown[0]).detach(), atol=1e-5)


def test_what_is_near_is_learnt_where_it_is_shown_each_category_as_much_as_another():
    pixels = torch.zeros(1, 2, 4, 4)
    pixels[0, 0, 0, 0] = pixels[0, 1, 2:, 2:] = 100.0  # one seen small, one large; both near
    batch = Labelled(
        torch.zeros(1, 3, 8, 8), pixels, pixels, torch.ones(1, 2, 2), torch.zeros(1, 2, 2)
    )

    def told(near):
        output = torch.zeros(1, 2, 4, 4), near, torch.zeros(1, 256), torch.zeros(1, 2, 2, 2)
        return perception_loss(output, batch)["near"].item()

    right = torch.where(pixels > 0, 8.0, 0.0)
    assert told(right) == pytest.approx(told(torch.full_like(pixels, 8.0)))
    small, large = right.clone(), right.clone()
    small[0, 0], large[0, 1] = -8.0, -8.0
    assert told(small) == pytest.approx(told(large))
    assert told(small) > 10 * told(right)


def test_nothing_is_near_that_is_not_shown(tmp_path):
    torch.manual_seed(0)
    sight = Sight.of(SMALL)
    export_perception(PerceptionNet(sight=sight), tmp_path / "p.onnx", camera=SMALL)
    seen = OnnxPerception(tmp_path / "p.onnx").observe(np.zeros((*sight.picture, 3), np.uint8))
    score, near = seen.detections[0, :, SCORES.index("score")], seen.detections[0, :, -1]
    assert (near > 0).all()
    assert (near < score).all()


@pytest.mark.parametrize("count", [1, AT_ONCE, 2 * AT_ONCE + 3])
def test_of_however_many_pictures_each_is_perceived_as_if_alone(count, tmp_path):
    sight = Sight.of(SMALL)
    export_perception(PerceptionNet(sight=sight), tmp_path / "p.onnx", camera=SMALL)
    perception = OnnxPerception(tmp_path / "p.onnx")
    pictures = np.random.default_rng(0).integers(
        256, size=(count, *sight.picture, 3), dtype=np.uint8
    )
    together = perception(pictures)
    assert len(together.features) == len(together.detections) == count
    for index, picture in enumerate(pictures):
        alone = perception(picture[None])
        assert (together.features[index] == alone.features[0]).all()
        assert (together.detections[index] == alone.detections[0]).all()


def test_training_tells_of_rooms_that_it_held_out_and_goes_on_where_it_was_killed(options):
    said = train(options)
    assert said["seen"] == 640
    assert said["training_rooms"] == 3
    held_out = said["held out, built_in"]
    assert held_out["rooms"] == 1
    assert held_out["pictures"] == 24
    assert {"shown_auc_mean", "near_auc_mean", "near_f1", "depth_relative_error"} < set(held_out)
    assert OnnxPerception(options.out).gives.camera == SMALL
    picture_set(options.data, 1003, kind="sweet_home.kitchen")
    picture_set(options.data, 1039, kind="sweet_home.kitchen")
    more = train(replace(options, pictures=704))
    assert more["seen"] == 704
    assert more["training_rooms"] == 4
    assert more["held out, sweet_home"]["rooms"] == 1


@pytest.mark.parametrize("room", [("kitchen", 301), ("kitchen", 21), ("sweet_home.bedroom", 324)])
def test_it_does_not_learn_from_rooms_that_test(options, room):
    kind, seed = room
    picture_set(options.data, seed, kind=kind)
    with pytest.raises(ValueError, match=f"found pictures of {kind}:{seed} in .* that tests"):
        train(options)
    assert not options.out.exists()


def test_a_network_is_written_by_one_process(options):
    with locked(options.out.with_suffix(".lock")), pytest.raises(OSError, match="another process"):
        train(options)


@pytest.mark.parametrize("file", ["other.checkpoint", "other.onnx"])
def test_a_network_begins_with_the_layers_of_another_camera(file, options, tmp_path):
    torch.manual_seed(5)
    other, net = PerceptionNet(), PerceptionNet(sight=Sight.of(SMALL))
    other(torch.rand(4, 3, *other.sight.picture))  # norms that are not as they were born
    save_state(tmp_path / "other.checkpoint", other, torch.optim.AdamW(other.parameters()), 64, {})
    export_perception(other, tmp_path / "other.onnx")
    before = net.geometry.weight.clone()
    begin_with(net, tmp_path / file)
    for name in ("trunk.stages.2.last.0.weight", "fine.1.running_var", "context.bias"):
        kept = other.state_dict()[name]
        if file == "other.onnx" and kept.numel() >= LEAST:
            kept = kept.half().float()
        assert torch.equal(net.state_dict()[name], kept)
    assert torch.equal(net.geometry.weight, before)  # of another size
    floats = sum(weight.numel() for weight in other.state_dict().values())
    assert (tmp_path / "other.onnx").stat().st_size < 0.6 * 4 * floats
    begun = replace(options, begin=tmp_path / file)
    train(replace(begun, pictures=64))
    assert train(replace(begun, pictures=128))["seen"] == 128
    with (tmp_path / file).open("ab") as same:
        same.write(b" ")
    with pytest.raises(CheckpointError, match=r"made with begin \".*, expected \".* only as what"):
        train(replace(begun, pictures=192))
    (tmp_path / file).unlink()
    with pytest.raises(CheckpointError, match=r"found no readable network at .*other"):
        train(replace(begun, pictures=192))


def test_a_killed_run_ends_as_if_it_had_never_stopped(options, tmp_path, monkeypatch):
    options = replace(options, pictures=320, checkpoint_s=0.0)
    whole = replace(options, out=tmp_path / "whole.onnx")
    train(whole)
    left = 5

    def until_killed(*given):
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        return augment(*given)

    monkeypatch.setattr("cfnav_core.perception.shelf.augment", until_killed)
    with pytest.raises(KeyboardInterrupt):
        train(options)
    monkeypatch.undo()
    train(options)
    ended, expected = (
        load_tensors(of.out.with_suffix(".checkpoint"), SUPERVISED)[0] for of in (options, whole)
    )
    assert ended.keys() == expected.keys()
    assert all(torch.equal(ended[name], expected[name]) for name in ended)


@pytest.mark.parametrize(
    ("other", "said"),
    [({"seed": 1}, "seed 0, expected 1"), ({"batch": 16}, "batch 32, expected 16"),
     ({"photographs": False}, "photographs true, expected false")],
)  # fmt: skip
def test_a_run_goes_on_only_as_what_it_was(options, other, said):
    train(replace(options, pictures=64))
    with pytest.raises(CheckpointError, match=f"made with {said}; a run goes on only as what"):
        train(replace(options, **other))


def test_a_network_of_more_pixels_begins_with_layers_that_are_stretched(tmp_path):
    torch.manual_seed(6)
    finer = replace(SMALL, size=(192, 128))
    other, net = PerceptionNet(sight=Sight.of(SMALL)), PerceptionNet(sight=Sight.of(finer))
    assert (other.sight.coarse, net.sight.coarse) == ((2, 3), (4, 6))
    save_state(tmp_path / "other.checkpoint", other, torch.optim.AdamW(other.parameters()), 64, {})
    begin_with(net, tmp_path / "other.checkpoint")
    # of a picture that is alike everywhere both have the same features
    sums = [of.squeeze[3].weight.view(256, 24, -1).sum(2) for of in (other, net)]
    torch.testing.assert_close(*sums, rtol=1e-4, atol=1e-5)
    # and each corner tells of itself
    tells = [of.geometry.weight.view(2, *of.sight.coarse, -1) for of in (other, net)]
    torch.testing.assert_close(tells[0][:, -1, -1], tells[1][:, -1, -1])


def test_a_network_of_another_camera_is_not_gone_on_with(options, tmp_path):
    train(replace(options, pictures=64))
    for seed in (1000, 1001, 1002, 1019):
        picture_set(tmp_path / "higher", seed, camera=replace(SMALL, z=0.5))
    before = options.out.read_bytes()
    with pytest.raises(CheckpointError, match=r"made with camera .*0\.3.*, expected .*0\.5"):
        train(replace(options, data=tmp_path / "higher"))
    assert options.out.read_bytes() == before


def test_a_network_is_replaced_only_when_the_new_one_is_whole(options, tmp_path, monkeypatch):
    net = PerceptionNet(sight=Sight.of(SMALL))
    export_perception(net, options.out, camera=SMALL)
    before = options.out.read_bytes()

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("cfnav_core.perception.net.describe", killed)
    with pytest.raises(KeyboardInterrupt):
        export_perception(net, options.out, camera=SMALL)
    assert options.out.read_bytes() == before
    assert not list(tmp_path.glob("*.partial"))


def test_what_no_network_was_saved_in_is_nothing_to_begin_with(tmp_path):
    layer = torch.nn.Linear(2, 2)
    save_state(tmp_path / "other.checkpoint", layer, torch.optim.AdamW(layer.parameters()), 64, {})
    with pytest.raises(
        CheckpointError, match=r"found no weights for trunk\.stem.* cfnav perception"
    ):
        begin_with(PerceptionNet(), tmp_path / "other.checkpoint")
    (tmp_path / "other.onnx").write_bytes(b"none")
    with pytest.raises(CheckpointError, match=r"found no readable network at .*other\.onnx"):
        begin_with(PerceptionNet(), tmp_path / "other.onnx")


def test_too_few_sets_are_one_sentence(tmp_path):
    picture_set(tmp_path, 1000)
    with pytest.raises(ValueError, match=r"found 1 picture sets to learn from and 0 held out"):
        train(PerceptionOptions(tmp_path, tmp_path / "p.onnx"))


def test_sets_that_are_all_held_out_are_one_sentence(tmp_path):
    for seed in (1019, 1039, 1059, 1079):
        picture_set(tmp_path, seed)
    with pytest.raises(ValueError, match=r"found 0 picture sets to learn from and 4 held out"):
        train(PerceptionOptions(tmp_path, tmp_path / "p.onnx"))


@pytest.mark.parametrize("seed", [1004, 1039])
def test_sets_of_another_camera_are_one_sentence(options, seed):
    picture_set(options.data, seed, camera=replace(SMALL, z=0.5))
    with pytest.raises(ValueError, match=rf"two cameras in .*, in kitchen_0{seed} of another"):
        train(options)
    assert not options.out.exists()


@pytest.mark.parametrize("damage", ["empty array", "no head", "other words"])
def test_a_damaged_set_is_one_sentence(options, damage):
    room = options.data / "kitchen_01001"
    if damage == "empty array":
        (room / "near.npy").write_bytes(b"")
    elif damage == "no head":
        (room / "set.json").write_text("[]")
    else:
        head = json.loads((room / "set.json").read_text())
        (room / "set.json").write_text(json.dumps(head | {"categories": head["categories"][::-1]}))
    with pytest.raises(ValueError, match=r"found .* in .*kitchen_01001.*make it again"):
        train(options)


def test_a_set_that_is_being_written_is_none_yet(options):
    (options.data / "kitchen_01002").rename(options.data / "kitchen_01002.partial")
    (options.data / "old").mkdir()
    (options.data / "old/set.json").write_text("{}")
    shelf = Shelf(options.data)
    shelf.look()
    assert [path.name for path in shelf.training] == ["kitchen_01000", "kitchen_01001"]
    assert [path.name for path in shelf.held_out] == ["kitchen_01019"]


def test_a_batch_is_of_many_rooms_and_made_again_from_its_seed(options):
    shelf = Shelf(options.data)
    shelf.look()
    first, again = (shelf.batch(32, np.random.default_rng(3)) for _ in range(2))
    assert torch.equal(first.pictures, again.pictures)
    assert first.pictures.shape == (32, 3, *Sight.of(SMALL).picture)
    assert torch.equal(first.heat.amax((2, 3)) > 0, first.visible > 0)
