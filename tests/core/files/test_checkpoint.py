"""Checkpoints that a disk has changed."""

import pytest
import torch
from safetensors.torch import save_file

from cfnav_core.files.checkpoint import CheckpointError, load_tensors, save_tensors


def test_a_flipped_byte_of_a_checkpoint_is_found(tmp_path):
    path, tensors = tmp_path / "some", {"a": torch.ones(3, 2), "steps": torch.tensor(5)}
    save_tensors(path, tensors, {"best": 0.5, "rooms": ["kitchen:0"]})
    expected, whole, refused = load_tensors(path), path.read_bytes(), 0
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            found = load_tensors(path)
        except CheckpointError as error:
            assert "delete it" in str(error)  # noqa: PT017
            refused += 1
            continue
        # only in the name of the checksum: the rest is what it was
        assert found[1] == expected[1]
        assert all(torch.equal(found[0][k], v) for k, v in expected[0].items())
    assert refused >= len(whole) - len("sha256")
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(CheckpointError, match="its checksum does not fit what it holds"):
        load_tensors(path)


def test_a_checkpoint_from_before_checksums_is_read(tmp_path):
    head = '{"schema": 1, "kind": "run", "best": 0.5}'
    save_file({"a": torch.ones(2)}, tmp_path / "old", {"head": head})
    tensors, said = load_tensors(tmp_path / "old")
    assert tensors["a"].tolist() == [1, 1]
    assert said["best"] == 0.5


def test_what_was_read_is_no_longer_in_the_file(tmp_path):
    """A tensor in the mapped file would change with it, and is not aligned as generators ask."""
    path = tmp_path / "some"
    save_tensors(path, {"a": torch.ones(100)}, {})
    tensors, _ = load_tensors(path)
    with path.open("r+b") as file:
        file.write(bytes(path.stat().st_size))
    assert tensors["a"].tolist() == [1] * 100


def test_the_same_content_makes_the_same_bytes(tmp_path):
    """So a bundle that is exported again is the same bundle; the library shuffles its metadata."""
    made = set()
    for _ in range(20):
        save_tensors(tmp_path / "some", {"a": torch.ones(2), "b": torch.ones(3)}, {"ä": "é"})
        made.add((tmp_path / "some").read_bytes())
    assert len(made) == 1
    tensors, said = load_tensors(tmp_path / "some")
    assert (tensors["b"].tolist(), said["ä"]) == ([1, 1, 1], "é")
