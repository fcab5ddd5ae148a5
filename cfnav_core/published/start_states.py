"""Start states of the published tests: pickle files in, frozen episodes as JSON out.

The files are pickles, and a pickle from a stranger may run anything. This reader admits containers,
numbers, strings and the published state class, and refuses everything else by name; word vectors
that lie beside them (numpy arrays, torch tensors) are passed over unread. Nothing else here loads
a pickle.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import re
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.files.whole import write_file
from cfnav_core.published.keys import Key
from cfnav_core.scenes.layouts import SUFFIX, room_of
from cfnav_core.scenes.scene import SceneError

SCHEMA = 1


@dataclass(frozen=True)
class StartState:
    """One frozen episode: scene name, state key (see ``keys.state_of``) and goal."""

    scene: str
    state: str
    goal: str


class ThorState:
    """Stands in for the published ThorAgentState; unpickling gives it x, z, rotation, horizon."""

    x: float
    z: float
    rotation: float
    horizon: float


class _Unread:
    """Stands in for an array or a tensor."""

    def __init__(self, *_: object) -> None: ...

    def __setstate__(self, _: object) -> None: ...


class _Dtype:
    """Stands in for the dtype of a numpy scalar."""

    def __init__(self, kind: str, *_: object) -> None:
        self.kind, self.order = str(kind), "|"

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.order = str(state[1])


def _scalar(dtype: _Dtype, data: bytes) -> float | int | bool | str:
    if not re.fullmatch(r"[biufU]\d+", dtype.kind) or dtype.order not in ("<", ">", "|", "="):
        raise ValueError(f"a number of type {dtype.order}{dtype.kind}")
    number: float | int | bool | str = np.frombuffer(data, dtype.order + dtype.kind)[0].item()
    return number


def _encode(text: str, _: str) -> bytes:
    """Old protocols write bytes as text."""
    return text.encode("latin1")


_ADMITTED = {
    ("collections", "OrderedDict"): OrderedDict,
    ("_codecs", "encode"): _encode,
    ("numpy", "ndarray"): _Unread,
    ("numpy", "dtype"): _Dtype,
    ("numpy.core.multiarray", "_reconstruct"): _Unread,
    ("numpy._core.multiarray", "_reconstruct"): _Unread,
    ("numpy.core.multiarray", "scalar"): _scalar,
    ("numpy._core.multiarray", "scalar"): _scalar,
    ("torch._utils", "_rebuild_tensor"): _Unread,
    ("torch._utils", "_rebuild_tensor_v2"): _Unread,
    # its bytes are a pickle again, which stays closed
    ("torch.storage", "_load_from_bytes"): _Unread,
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if name == "ThorAgentState":  # the repositories keep it in different modules
            return ThorState
        if (module, name) not in _ADMITTED:
            raise SceneError(
                f"found {module}.{name}, expected only containers, numbers, strings and "
                "ThorAgentState"
            )
        return _ADMITTED[module, name]


def read_pickle(path: Path) -> list[StartState]:
    """Read a published file of test or validation episodes.

    Raises:
        SceneError: it holds anything but episodes; the message names what was found.
    """
    try:
        with path.open("rb") as file:
            entries = _Unpickler(file).load()
        return [_start_state(entry) for entry in entries]
    except SceneError as error:
        raise SceneError(f"{error} (in {path}, which is not used)") from error
    except (OSError, pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError,
            AttributeError, OverflowError) as error:  # fmt: skip
        raise SceneError(
            f"found no list of episodes with scene, state and goal_object_type in {path} "
            f"({type(error).__name__}: {error}); download it again"
        ) from error


def _start_state(entry: dict[str, Any]) -> StartState:
    state, scene, goal = entry["state"], entry["scene"], entry["goal_object_type"]
    if isinstance(state, ThorState):
        state = f"{state.x:.2f}|{state.z:.2f}|{state.rotation:.0f}|{state.horizon:.0f}"
    if not all(isinstance(text, str) for text in (state, scene, goal)):
        raise TypeError(f"an entry with {state!r}, {scene!r}, {goal!r}")
    room_of(scene)
    return StartState(scene.removesuffix(SUFFIX), str(Key.parse(state)), goal)


def identity(episodes: Sequence[StartState]) -> str:
    """SHA-256 of scenes, states and goals in order."""
    text = json.dumps([astuple(e) for e in episodes], separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def write_episodes(path: Path, episodes: Sequence[StartState], made_from: Sequence[Path]) -> None:
    """Write frozen episodes, one a line; the file appears only when complete.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    head = {
        "schema": SCHEMA, "sha256": identity(episodes),
        "made_from": {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in made_from},
    }  # fmt: skip
    lines = ",\n  ".join(json.dumps(asdict(e)) for e in episodes)
    text = json.dumps(head, indent=1)[:-2] + f',\n "episodes": [\n  {lines}\n ]\n}}\n'
    write_file(path, text)


def read_episodes(path: Path) -> list[StartState]:
    """Read frozen episodes.

    Raises:
        SceneError: the file is missing, damaged, or its episodes are not those of its hash.
    """
    try:
        data = json.loads(path.read_text())
        episodes = [StartState(**entry) for entry in data["episodes"]]
        found, expected = (data["schema"], identity(episodes)), (SCHEMA, data["sha256"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SceneError(
            f"found no readable episodes in {path} ({error}); make them with cfnav data episodes"
        ) from error
    if found != expected:
        raise SceneError(f"found episodes in {path} that are not those of its hash and schema; "
                         "make them again with cfnav data episodes")  # fmt: skip
    return episodes
