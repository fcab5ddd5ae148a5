"""Two processes under torchrun do what one does with all the episodes."""

import json
import os
import re
import subprocess
import sys

import pytest
import torch

from cfnav_core.agent.config import TrainOptions
from cfnav_core.files.checkpoint import load_tensors
from cfnav_core.learn.ranks import Ranks
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import CHECKPOINT
from cfnav_core.learn.train import Synchronous
from tests.conftest import DEADLINE_S, wait_until
from tests.core.worlds import hall

TORCHRUN = ("-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2")


def command(scenes, out, *launcher: str, stage2: int = 120) -> list[str]:
    return [
        sys.executable, *launcher, "-m", "cfnav.cli", "train", "--scenes", str(scenes),
        "--train-rooms", "kitchen:0", "--validation-rooms", "kitchen:1", "--out", str(out),
        "--stage1-episodes", "120", "--stage2-episodes",
        str(stage2), "--batch", "16", "--hidden", "16",
        "--predictor-hidden", "8", "--validation-every", "100", "--validation-episodes", "20",
    ]  # fmt: skip


@pytest.fixture
def scenes(tmp_path):
    for seed in range(2):
        hall(4, 3, seed=seed, name=f"kitchen:{seed}").save(tmp_path / "s" / f"kitchen_{seed:05d}")
    return tmp_path / "s"


def networks(tensors):
    return [name for name in tensors if name.startswith(("model.", "predictor."))]


ONE_THREAD = {**os.environ, "OMP_NUM_THREADS": "1"}


def test_two_ranks_do_what_one_does(scenes, tmp_path):
    for name, launcher in (("one", ()), ("two", TORCHRUN)):
        line = command(scenes, tmp_path / name, *launcher)
        subprocess.run(line, check=True, capture_output=True, text=True, env=ONE_THREAD)
    (one, head), (two, other) = (
        load_tensors(tmp_path / name / CHECKPOINT) for name in ("one", "two")
    )
    assert head["episodes"] == other["episodes"] >= 240
    assert head["steps"] == other["steps"]
    assert any(k.startswith("predictor.") for k in networks(one))
    for key in networks(one):
        torch.testing.assert_close(one[key], two[key], atol=2e-3, rtol=0.02, msg=key)
    logs = [
        [json.loads(line) for line in (tmp_path / name / "log.jsonl").read_text().splitlines()]
        for name in ("one", "two")
    ]
    assert [row["sr"] for row in logs[0]] == [row["sr"] for row in logs[1]]


@pytest.mark.long
def test_two_ranks_that_were_stopped_go_on_as_two_that_were_not(scenes, tmp_path):
    whole = command(scenes, tmp_path / "whole", *TORCHRUN)
    subprocess.run(whole, check=True, capture_output=True, text=True, env=ONE_THREAD)
    two, other = load_tensors(tmp_path / "whole" / CHECKPOINT)
    line = [*command(scenes, tmp_path / "stopped", *TORCHRUN), "--checkpoint-s", "0"]
    process = subprocess.Popen(line, stderr=subprocess.DEVNULL, env=ONE_THREAD)
    wait_until((tmp_path / "stopped" / CHECKPOINT).exists, "a checkpoint")
    process.terminate()
    process.wait(DEADLINE_S)
    stopped, head = load_tensors(tmp_path / "stopped" / CHECKPOINT)
    assert head["episodes"] < 240
    subprocess.run(line, check=True, capture_output=True, text=True, env=ONE_THREAD)
    again, head = load_tensors(tmp_path / "stopped" / CHECKPOINT)
    assert head["steps"] == other["steps"]
    assert again.keys() == two.keys() == stopped.keys()
    kept = [k for k in two if k.startswith(("carried.rows.env.", "carried.streams."))]
    assert len(kept) == 7
    assert [k for k in kept if not torch.equal(again[k], two[k])] == []
    for key in networks(two):
        torch.testing.assert_close(again[key], two[key], atol=2e-3, rtol=0.02, msg=key)


THREADS = """
import time
from contextlib import suppress
from pathlib import Path

from cfnav.cli import main
from cfnav_core.learn.ranks import Ranks

def threads():
    names = []
    for path in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):  # it ended meanwhile
            names.append(path.read_text().strip())
    return names

def watched(ranks, leave=Ranks.leave):
    assert "pt_gloo_runloop" in threads(), threads()
    leave(ranks)

Ranks.leave = watched
main()
deadline = time.monotonic() + 60
while "pt_gloo_runloop" in threads():  # one that was joined is listed a little longer
    assert time.monotonic() < deadline, threads()
"""


def test_no_thread_of_the_group_outlives_a_run(scenes, tmp_path):
    # one that lets go of a tensor while Python ends aborts the process
    script = tmp_path / "train.py"
    script.write_text(THREADS)
    line = command(scenes, tmp_path / "run", *TORCHRUN)
    at = line.index("cfnav.cli")
    line[at - 1 : at + 1] = [str(script)]
    subprocess.run(line, check=True, capture_output=True, text=True, env=ONE_THREAD)


def test_ranks_that_are_told_to_stop_write_a_checkpoint(scenes, tmp_path):
    line = command(scenes, tmp_path / "run", *TORCHRUN, stage2=50_000)
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=ONE_THREAD)
    try:
        wait_until((tmp_path / "run" / "log.jsonl").exists, "the log")
        process.terminate()
        _, text = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    said = re.findall(r"cfnav: stopped after (\d+) of 50120 episodes", text)
    _, head = load_tensors(tmp_path / "run" / CHECKPOINT)
    assert said == [str(head["episodes"])] * 2
    assert process.returncode != 0


def test_every_rank_has_its_own_dropout(scenes, tmp_path, monkeypatch):
    seeds = []
    for rank in range(2):
        monkeypatch.setattr(Ranks, "join", classmethod(lambda cls, rank=rank: cls(rank, 2)))
        run = Run(TrainOptions(scenes, ("kitchen:0",), ("kitchen:1",), tmp_path / "run"))
        Synchronous(run)
        seeds.append(torch.initial_seed())
    assert seeds[0] != seeds[1]


def test_episodes_that_cannot_be_shared_are_refused():
    with pytest.raises(ValueError, match="found 15 parallel episodes for 2 processes"):
        Ranks(0, 2).part(15)
    parts = [Ranks(rank, 2).part(16) for rank in range(2)]
    assert [(p.first, p.batch, p.total) for p in parts] == [(0, 8, 16), (8, 8, 16)]
