"""Training state to and from disk: safetensors for numbers, no pickle anywhere.

A checksum over all that is read again stands beside it; files that were made before have none.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn

from cfnav_core.files.whole import whole, writing

SCHEMA = 1
SUPERVISED = "supervised"
"""Kind of ``save_state``."""


class CheckpointError(ValueError):
    """A checkpoint is damaged or of another network; the message says which."""


def save_tensors(
    path: Path, tensors: dict[str, Tensor], head: dict[str, Any], kind: str = "run"
) -> None:
    """Write named tensors, a JSON head and their checksum; the file appears only when complete.

    The same content makes the same bytes.

    Args:
        kind: what is saved; ``load_tensors`` asks for it again.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    copies = {k: v.detach().clone().contiguous() for k, v in tensors.items()}
    text = json.dumps({"schema": SCHEMA, "kind": kind, **head})
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial:
            said = {"head": text, "sha256": _checksum(copies, text)}
            with partial.open("wb") as file:
                file.writelines(_in_order(save(copies, said)))


def load_tensors(path: Path, kind: str = "run") -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read what ``save_tensors`` wrote.

    Raises:
        CheckpointError: missing, damaged, of another kind or schema.
    """
    try:
        # opened once: torch's own reader opens the name a second time, when a run that goes on
        # may have put its next checkpoint there
        content = path.read_bytes()
        # in memory of their own: in the file they are aligned to 8 bytes only, with which
        # generators of random numbers crash and sums may round differently
        tensors = {name: tensor.clone() for name, tensor in load(content).items()}
        header_bytes = int.from_bytes(content[:8], "little")
        said = json.loads(content[8 : 8 + header_bytes]).get("__metadata__", {})
        if said.get("sha256", wanted := _checksum(tensors, said["head"])) != wanted:
            raise ValueError("its checksum does not fit what it holds")
        head = json.loads(said["head"])
        found = head["kind"], head["schema"]
    except (OSError, SafetensorError, KeyError, ValueError, TypeError) as error:
        raise CheckpointError(
            f"found no readable checkpoint at {path} ({error}); name another file, or delete it to "
            "start again"
        ) from error
    if found != (kind, SCHEMA):
        raise CheckpointError(
            f"found a checkpoint of kind {found[0]!r} and schema {found[1]} at {path}, expected "
            f"{kind!r} and {SCHEMA}; name another file, or train again"
        )
    return tensors, head


def _in_order(content: bytes) -> tuple[bytes | memoryview, ...]:
    """Parts of a safetensors file with its metadata in order, which the library shuffles.

    Source: its format: the table's length, 8 bytes; the table, in JSON; numbers as in memory.
    """
    start = 8 + int.from_bytes(content[:8], "little")
    table = json.loads(content[8:start])
    table["__metadata__"] = dict(sorted(table["__metadata__"].items()))
    ordered = json.dumps(table, separators=(",", ":")).encode()
    ordered += b" " * (-len(ordered) % 8)  # numbers begin at a multiple of 8
    return len(ordered).to_bytes(8, "little"), ordered, memoryview(content)[start:]


def _checksum(tensors: dict[str, Tensor], head: str) -> str:
    """SHA-256 of a head and of names, kinds, shapes and numbers of tensors, hexadecimal."""
    sum_ = hashlib.sha256(head.encode())
    for name, tensor in sorted(tensors.items()):
        sum_.update(f"\n{name} {tensor.dtype} {list(tensor.shape)}\n".encode())
        sum_.update(tensor.cpu().flatten().view(torch.uint8).numpy().data)
    return sum_.hexdigest()


def optimizer_tensors(prefix: str, optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """The optimizer's state as named tensors."""
    state = optimizer.state_dict()["state"]
    return {
        f"{prefix}.{i}.{key}": torch.as_tensor(v)
        for i, row in state.items()
        for key, v in row.items()
    }


def restore_optimizer(
    path: Path, prefix: str, optimizer: torch.optim.Optimizer, tensors: dict[str, Tensor]
) -> None:
    """Put back what ``optimizer_tensors`` took out.

    Raises:
        CheckpointError: it is of other weights.
    """
    weights = [weight for group in optimizer.param_groups for weight in group["params"]]
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        if name.startswith(prefix + "."):
            _, number, key = name.rsplit(".", 2)
            index = int(number)
            if index >= len(weights) or (value.dim() and value.shape != weights[index].shape):
                raise CheckpointError(
                    f"found a checkpoint of another network at {path}: {name} fits no weight of "
                    f"{len(weights)}; name another file, or delete it to start again"
                )
            state.setdefault(index, {})[key] = value
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": state, "param_groups": groups})
    # torch's fused optimizers walk numbers as they lie in memory, so those that go with a weight
    # have to lie as the weight does
    for weight, row in optimizer.state.items():
        for key, value in row.items():
            if value.dim():
                row[key] = torch.empty_like(weight).copy_(value)


def save_state(
    path: Path, net: nn.Module, optimizer: torch.optim.Optimizer, seen: int, run: dict[str, Any]
) -> None:
    """Checkpoint of a supervised run.

    Args:
        path: where to.
        net, optimizer: their state is kept.
        seen: samples.
        run: settings that the result depends on, as JSON has them.
    """
    tensors = {f"net.{k}": v for k, v in net.state_dict().items()}
    tensors |= optimizer_tensors("optimizer", optimizer)
    save_tensors(path, tensors, {"seen": seen, "run": run}, SUPERVISED)


def load_state(
    path: Path, net: nn.Module, optimizer: torch.optim.Optimizer, run: dict[str, Any]
) -> int:
    """Restore ``save_state``; returns the number of samples seen.

    A file that was made before these had settings is taken as it is.

    Raises:
        CheckpointError: damaged, of another network, or of a run with other settings.
    """
    tensors, head = load_tensors(path, SUPERVISED)
    before = head.get("run", run)
    if other := [name for name in run if before.get(name) != run[name]]:
        name = other[0]
        raise CheckpointError(
            f"found a checkpoint at {path} made with {name} {json.dumps(before.get(name))}, "
            f"expected {json.dumps(run[name])}; a run goes on only as what it was: name another "
            "--out, or delete it to start again"
        )
    load_module(path, "net", net, tensors)
    restore_optimizer(path, "optimizer", optimizer, tensors)
    return int(head["seen"])


def load_module(path: Path, prefix: str, module: nn.Module, tensors: dict[str, Tensor]) -> None:
    """Load the weights stored under a prefix.

    Raises:
        CheckpointError: names or shapes differ.
    """
    own = {k[len(prefix) + 1 :]: v for k, v in tensors.items() if k.startswith(prefix + ".")}
    try:
        module.load_state_dict(own)
    except RuntimeError as error:
        raise CheckpointError(
            f"found a checkpoint of another network at {path}: {error}"
        ) from error
