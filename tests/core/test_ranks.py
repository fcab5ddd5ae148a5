"""Two processes under torchrun do what one does with all the episodes."""

import json
import os
import subprocess
import sys

import pytest
import torch

from cfnav_core.checkpoint import load_tensors
from cfnav_core.ranks import Ranks
from cfnav_core.run import CHECKPOINT

from .worlds import hall


def train(scenes, out, *launcher: str) -> None:
    command = [
        sys.executable, *launcher, "-m", "cfnav_core.cli", "train", "--scenes", str(scenes),
        "--train-rooms", "kitchen:0", "--validation-rooms", "kitchen:1", "--out", str(out),
        "--stage1-episodes", "120", "--stage2-episodes",
        "120", "--batch", "16", "--hidden", "16",
        "--predictor-hidden", "8", "--validation-every", "100", "--validation-episodes", "20",
    ]  # fmt: skip
    subprocess.run(
        command, check=True, capture_output=True, env={**os.environ, "OMP_NUM_THREADS": "1"}
    )


def test_two_ranks_do_what_one_does(tmp_path):
    for seed in range(2):
        hall(4, 3, seed=seed, name=f"kitchen:{seed}").save(tmp_path / "s" / f"kitchen_{seed:05d}")
    train(tmp_path / "s", tmp_path / "one")
    torchrun = ("-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2")
    train(tmp_path / "s", tmp_path / "two", *torchrun)
    (one, head), (two, other) = (
        load_tensors(tmp_path / name / CHECKPOINT) for name in ("one", "two")
    )
    assert head["episodes"] == other["episodes"] >= 240
    assert head["steps"] == other["steps"]
    moved = [k for k in one if k.startswith(("model.", "predictor."))]
    assert any(k.startswith("predictor.") for k in moved)
    for key in moved:
        torch.testing.assert_close(one[key], two[key], atol=2e-3, rtol=0.02, msg=key)
    logs = [
        [json.loads(line) for line in (tmp_path / name / "log.jsonl").read_text().splitlines()]
        for name in ("one", "two")
    ]
    assert [row["sr"] for row in logs[0]] == [row["sr"] for row in logs[1]]


def test_episodes_that_cannot_be_shared_are_refused():
    with pytest.raises(ValueError, match="found 15 parallel episodes for 2 processes"):
        Ranks(0, 2).part(15)
    parts = [Ranks(rank, 2).part(16) for rank in range(2)]
    assert [(p.first, p.batch, p.of) for p in parts] == [(0, 8, 16), (8, 8, 16)]
