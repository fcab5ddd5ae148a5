"""How fast training is, beside what the machine allows: ``python -m studies.bench.train``.

For each row a process of its own trains on synthetic scenes and reports steps per CPU-second (on a
GPU per second). The bound is the device's rate of matrix multiplies on the networks' own shapes,
measured in the same process, divided by the multiplications of one step of learning, counted by
torch. Nothing is asserted; the machine's load stands beside the figures.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from cfnav_core.agent.agent import Agent, new_agent
from cfnav_core.agent.config import Hyperparameters, MethodName, ModelName, RunConfig
from cfnav_core.agent.methods import METHODS
from cfnav_core.command import run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.learn.algorithm import Learner
from cfnav_core.learn.env import CPU, ObjectNavEnv, SceneBank
from cfnav_core.learn.ranks import Ranks
from cfnav_core.learn.train import keep_freed_memory, peak_memory_mb
from cfnav_core.models.base import Knowledge
from cfnav_core.models.size import PUBLISHED, ModelSize
from cfnav_core.models.table import MODELS
from cfnav_core.scenes.scene import HEADINGS, HORIZONS, OfflineScene
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.detections import fields_before_names

SHAPES = {
    "full": ((512, 7, 7), 517, 22), "clip": ((2048, 7, 7), 517, 22), "boxes": ((512, 7, 7), 4, 101),
    "compact": ((256,), 5, 38),
}  # fmt: skip
"""Features, numbers a detection, objects: Data 1, its CLIP form, Data 2, built-in rooms."""

FULL_DATA = {"baseline_word": "boxes", "mjolnir": "boxes", "tdanet": "boxes", "akgvp": "clip"}
"""Which published data a model reads; the others read Data 1."""


@dataclass(frozen=True)
class Measurement:
    """One measurement.

    Attributes:
        model: row of ``MODELS``. width: "full" or "compact". method: row of ``METHODS``.
        stage: 1 or 2. parallel: episodes at once in each process. ranks: processes.
        precision: of multiplications, see ``TrainOptions``. device: "cpu" or "cuda".
    """

    model: ModelName
    width: str
    method: MethodName
    stage: int = 1
    parallel: int = 64
    ranks: int = 1
    precision: str = "highest"
    device: str = "cpu"


@dataclass(frozen=True)
class TrainBenchOptions:
    """Measure training."""

    out: Path = Path("out/bench")
    """Folder that gets train.json."""
    seconds: float = 8.0
    """CPU-seconds of a row, at least one update."""
    quick: bool = False
    """Few rows, for a look."""
    row: str | None = None
    """Measure this one row (JSON) and print it; used by the command itself."""


def rows(quick: bool) -> list[Measurement]:
    """What is measured."""
    first = [
        Measurement("baseline_label", "full", "plain"),
        Measurement("baseline_label", "full", "ours"),
        Measurement("compact", "compact", "ours"), Measurement("compact", "compact", "ours", 2),
        Measurement("baseline_label", "full", "plain", ranks=2),
        Measurement("baseline_label", "full", "plain", precision="medium"),
        Measurement("baseline_label", "full", "ours", precision="medium"),
    ]  # fmt: skip
    if torch.cuda.is_available():
        first += [
            Measurement(
                "baseline_label", "full", method, parallel=n, precision="high", device="cuda"
            )
            for method in ("plain", "ours") for n in (64, 1024, 4096)
        ]  # fmt: skip
    if quick:
        return first
    models = [
        Measurement(m, w, "plain") for m in MODELS for w in ("full", "compact") if m != "compact"
    ]
    growth = [Measurement("compact", "compact", "plain", parallel=4**k) for k in range(7)]
    growth += [Measurement("baseline_label", "full", "plain", parallel=4**k) for k in range(7)]
    return list(dict.fromkeys(first + models + growth))


def synthetic_bank(shape: str, positions: int = 128, device: torch.device = CPU) -> SceneBank:
    """A bare hall with random features, of the given data's shapes."""
    features, detections, count = SHAPES[shape]
    rng, side = np.random.default_rng(0), int(positions**0.5)
    n = side * side * HEADINGS * HORIZONS
    index = np.arange(n)
    position, heading = index // (HEADINGS * HORIZONS), index // HORIZONS % HEADINGS
    x, y = position % side, position // side
    angle = heading * np.pi / 4
    to_x, to_y = x + np.rint(np.cos(angle)).astype(int), y + np.rint(np.sin(angle)).astype(int)
    free = (to_x >= 0) & (to_x < side) & (to_y >= 0) & (to_y < side)
    moved = ((to_y * side + to_x) * HEADINGS + heading) * HORIZONS + index % HORIZONS
    turn = position * HEADINGS * HORIZONS + index % HORIZONS
    following = np.tile(index[:, None], (1, NUM_ACTIONS)).astype(np.int32)
    following[:, Action.MoveAhead] = np.where(free, moved, index)
    following[:, Action.RotateLeft] = turn + (heading + 1) % HEADINGS * HORIZONS
    following[:, Action.RotateRight] = turn + (heading - 1) % HEADINGS * HORIZONS
    following[:, Action.LookUp] = index // HORIZONS * HORIZONS
    following[:, Action.LookDown] = index // HORIZONS * HORIZONS + 1
    objects = tuple(f"object{k}" for k in range(count))
    return SceneBank([OfflineScene(
        name="kitchen:0", room_type="kitchen", perception="synthetic", source="synthetic",
        objects=objects, goals=objects,
        features=rng.random((n, *features), np.float32).astype(np.float16),
        detections=rng.random((n, count, detections), np.float32).astype(np.float16),
        next_state=following, collided=~free, visible=rng.random((n, count)) < 0.05,
        position=position.astype(np.int32), heading=heading.astype(np.int8),
        horizon=(index % HORIZONS).astype(np.int8),
        positions=np.stack([x, y], 1)[:: HEADINGS * HORIZONS].astype(np.float32) / 4,
        instances=np.ones(count, np.int16),
        distance=rng.random((side * side, count), np.float32),
        fields=fields_before_names(detections),
    )], device=device)  # fmt: skip


def synthetic_knowledge(objects: int) -> Knowledge:
    """Tables of the right shapes."""
    rng = np.random.default_rng(0)
    return Knowledge(
        words=rng.normal(size=(objects, 300)).astype(np.float32),
        text=rng.normal(size=(objects, 1024)).astype(np.float32),
        zones=rng.random((4, 8, objects), np.float32),
        zone_edges=rng.uniform(0.05, 0.2, (4, 8, 8)).astype(np.float32),
        layout=rng.integers(1, 500, (4, objects, objects)).astype(np.float32)
        * (1 - np.eye(objects, dtype=np.float32)),
        adjacency=(rng.random((objects, objects)) < 0.2).astype(np.float32),
        parents=rng.random((4, objects, objects), np.float32),
    )


class BenchedAgent:
    """An agent at work on synthetic scenes."""

    def __init__(self, row: Measurement) -> None:
        shape = FULL_DATA.get(row.model, "full") if row.width == "full" else "compact"
        self.ranks = Ranks.join()
        self.device = self.ranks.device(row.device)
        self.bank = synthetic_bank(shape, device=self.device)
        size = PUBLISHED if row.width == "full" else ModelSize()
        config = RunConfig(
            method=row.method, model=row.model, size=size,
            predictor_hidden=512 if row.width == "full" else 128,
        )  # fmt: skip
        torch.manual_seed(0)
        known = synthetic_knowledge(len(self.bank.objects))
        self.agent: Agent = new_agent(config, self.bank.inputs, known, self.device)
        part = self.ranks.part(row.parallel * self.ranks.size)
        env, self.hp = ObjectNavEnv(self.bank, part, np.random.default_rng(0)), Hyperparameters()
        method = METHODS[row.method]
        self.stage = method.stage1 if row.stage == 1 else method.stage2
        self.learner = Learner(env, self.agent, self.hp, torch.Generator(), self.ranks)
        self.policy, self.predictor = (
            torch.optim.Adam(own, self.hp.lr, fused=True) for own in self.agent.parameters()
        )

    def update(self) -> int:
        """One update; returns its steps."""
        self.learner.update(self.stage, self.policy, self.predictor, self.hp.lr)
        return self.learner.env.part.total * self.hp.rollout_length

    def time(self) -> float:
        """CPU-seconds of this process; on a GPU seconds, when all that was asked for is done."""
        if self.device.type == "cpu":
            return time.process_time()
        torch.cuda.synchronize(self.device)
        return time.monotonic()


def measure(row: Measurement, seconds: float) -> dict[str, Any]:
    """Steps per CPU-second and per second of a row, its multiplications and its peak memory."""
    keep_freed_memory()
    torch.set_num_threads(1)
    torch.set_float32_matmul_precision(row.precision)
    if row.device == "cpu":  # a row that does not fit fails alone, and takes nobody along
        resource.setrlimit(resource.RLIMIT_DATA, 2 * (available_bytes() // row.ranks,))
    bench = BenchedAgent(row)
    with FlopCounterMode(display=False) as counter:
        steps = bench.update() / bench.ranks.size
    flops = counter.get_total_flops() / steps
    start, wall, done, going = bench.time(), time.monotonic(), 0, True
    while going:
        done += bench.update()
        spent = time.monotonic() - wall
        going = bench.ranks.total(spent)[0] < seconds * bench.ranks.size
    rate = done / bench.ranks.size / (bench.time() - start)
    each_step, each_rollout = matmul_gflops(bench, row)
    bench.ranks.leave()
    return {
        **asdict(row), "steps_per_cpu_s": round(rate, 1), "steps_per_s": round(done / spent, 1),
        "mflop_per_step": round(flops / 1e6, 2), "matmul_gflops": round(each_step, 1),
        "fraction_of_bound": round(rate * flops / (each_step * 1e9), 3),
        "fraction_of_rollout_bound": round(rate * flops / (each_rollout * 1e9), 3),
        "peak_rss_mb": round(peak_memory_mb()),
        "leads": bench.ranks.leads,
    }  # fmt: skip


def matmul_gflops(
    bench: BenchedAgent, row: Measurement, seconds: float = 1.0
) -> tuple[float, float]:
    """Rates of multiplies on the shapes of the networks' layers, forward and both gradients.

    Every weight [N, K] with as many rows as one step brings it: places of a map for convolutions,
    episodes for all others. Each shape counts by its share of the multiplications.

    Returns:
        The rate with all products made at every step, and the stricter one with the weight
        gradients of LSTM layers made once a rollout.
    """
    side = bench.bank.inputs.features[-1] if len(bench.bank.inputs.features) == 3 else 3
    networks: list[nn.Module] = [bench.agent.model]
    if bench.stage.train_predictor:
        networks.append(bench.agent.predictor)
    products: list[tuple[Tensor, int, int]] = []  # weight, rows of a step, rollout steps at once
    for module in (m for network in networks for m in network.modules()):
        if isinstance(module, nn.Conv2d):
            products.append((module.weight.flatten(1), row.parallel * side**2, 1))
        elif isinstance(module, nn.Linear):
            products.append((module.weight, row.parallel, 1))
        elif isinstance(module, nn.LSTMCell):
            weights, steps = (module.weight_ih, module.weight_hh), bench.hp.rollout_length
            products += [(weight, row.parallel, steps) for weight in weights]
    flops = each_step = each_rollout = 0.0
    with torch.no_grad():
        for weight, rows, steps in products:
            (n, k), device = weight.shape, weight.device
            time_of = partial(_seconds, bench, least=seconds / len(products) / 4)
            x, g = (torch.randn(rows * steps, width, device=device) for width in (k, n))
            both = time_of(partial(torch.mm, x[:rows], weight.t()))
            both += time_of(partial(torch.mm, g[:rows], weight))
            each_step += both + time_of(partial(torch.mm, g[:rows].t(), x[:rows]))
            each_rollout += both + time_of(partial(torch.mm, g.t(), x)) / steps
            flops += 6.0 * n * k * rows
    return flops / each_step / 1e9, flops / each_rollout / 1e9


def _seconds(bench: BenchedAgent, call: Callable[[], Tensor], least: float) -> float:
    """Of one call, the second of two measurements of at least so many seconds."""
    once = 0.0
    for _ in range(2):
        start, count = bench.time(), 0
        while bench.time() - start < least / 2 or not count:
            for _ in range(1 + count):  # ever more at once, so that looking at the clock is free
                call()
            count += 1 + count
        once = (bench.time() - start) / count
    return once


def available_bytes() -> int:
    """Main memory that nobody uses now."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))


def measure_env(parallel: int, seconds: float) -> float:
    """Steps per CPU-second without a network: actions drawn beforehand, episodes restarted."""
    torch.set_num_threads(1)
    env = ObjectNavEnv(synthetic_bank("compact"), parallel, np.random.default_rng(0))
    actions = torch.randint(0, NUM_ACTIONS - 1, (64, parallel))
    done, start = 0, time.process_time()
    while time.process_time() - start < seconds:
        for action in actions:
            result = env.step(action)
            env.restart(result.ended)
        done += actions.numel()
    return done / (time.process_time() - start)


def memory_gb_per_s(megabytes: int = 512) -> float:
    """Bytes read and written a second by one core that copies, the best of five times."""
    source = torch.ones(megabytes << 20, dtype=torch.uint8)
    target, best = torch.zeros_like(source), np.inf
    for _ in range(5):
        start = time.process_time()
        target.copy_(source)
        best = min(best, time.process_time() - start)
    return 2 * source.numel() / best / 1e9


def run_row(row: Measurement, seconds: float) -> dict[str, Any]:
    """Measure a row in processes of its own.

    Raises:
        MemoryError: this machine has too little memory for it.
        RuntimeError: it failed; the message is the last line it wrote.
    """
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(row.ranks)]
    command = [
        sys.executable, *(launcher if row.ranks > 1 else []), "-m", "studies.bench.train",
        "--seconds", str(seconds), "--row", json.dumps(asdict(row)),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "can't allocate memory" in done.stderr or "CUDA out of memory" in done.stderr:
        raise MemoryError(f"{row} does not fit into {available_bytes() >> 30} GiB")
    if done.returncode:
        raise RuntimeError(f"{row} failed: {done.stderr.strip().splitlines()[-1:]}")
    return dict(json.loads(done.stdout))


def main(options: TrainBenchOptions) -> None:
    """Measure, print and write."""
    if options.row is not None:
        found = measure(Measurement(**json.loads(options.row)), options.seconds)
        if found.pop("leads"):
            print(json.dumps(found))
        return
    load = os.getloadavg()[0]
    print(f"load {load:.2f} before the start, {os.cpu_count()} cores of {_processor()}")
    measured: list[dict[str, Any]] = []
    failed: list[str] = []
    for row in rows(options.quick):
        try:
            measured.append(run_row(row, options.seconds))
        except (MemoryError, RuntimeError) as error:
            failed.append(str(error))
            print(error, flush=True)
        else:
            print(_line(measured[-1]), flush=True)
    env = {n: round(measure_env(n, 2.0)) for n in (1, 256, 4096, 65_536)}
    bandwidth = round(memory_gb_per_s(), 1)
    print("environment alone, steps/CPU-s: " + ", ".join(f"{n}: {v:,}" for n, v in env.items())
          + f"; memory {bandwidth} GB/s")  # fmt: skip
    rate = {
        Measurement(**{f.name: r[f.name] for f in fields(Measurement)}): r["steps_per_s"]
        for r in measured
    }
    one, two = (rate.get(Measurement("baseline_label", "full", "plain", ranks=n)) for n in (1, 2))
    speedup = round(two / one, 2) if one and two else None
    print(f"two processes are {speedup} times as fast as one")
    write_json(options.out / "train.json", {
        "matmul_gflops": measured[0]["matmul_gflops"] if measured else None, "rows": measured,
        "env": [{"parallel": n, "steps_per_cpu_s": v} for n, v in env.items()],
        "memory_gb_per_s": bandwidth, "two_rank_speedup": speedup, "load": load,
        "failed": failed,
    })  # fmt: skip


def _line(found: dict[str, Any]) -> str:
    return (
        f"{MODELS[found['model']].title:<17}{found['width']:<9}{found['method']:<7}"
        f"stage {found['stage']}  "
        f"{found['ranks']} x {found['parallel']:>4} episodes  {found['precision']:<8}"
        f"{found['device']:<5}{found['steps_per_cpu_s']:>9.0f} steps/CPU-s  "
        f"{found['fraction_of_bound']:>5.0%} of the bound, "
        f"{found['fraction_of_rollout_bound']:.0%} of the stricter one  "
        f"{found['peak_rss_mb']:>5} MB"
    )


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


if __name__ == "__main__":
    sys.exit(run_options("bench_train", TrainBenchOptions, main))
