"""What better eyes would be worth: ``python -m studies.eyes.ceiling POLICY --scenes DIR``.

A policy walks the same episodes four times: as it is, with the true collision flag for p_hat, with
the truth of what is near, and with both. What the last does not reach is the policy's own.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cfnav_core.command import run_options
from cfnav_core.learn.evaluate import evaluate, paired_difference
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.select import open_scenes
from cfnav_core.task.detections import SCORES
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import figures, paired_text
from cfnav_core.task.rooms import parse_room, room_folder
from studies.engine.pages import Cell, table
from studies.engine.policy_in_scenes import PolicyInScenes

COLUMNS: dict[str, Cell] = {
    "given": lambda row: row["given"],
    "CF-SR": lambda row: f"{row['cf_sr']:.3f} {ends_text(row['cf_sr_interval'])}",
    "SR": lambda row: f"{row['sr']:.3f}",
    "wrong Done": lambda row: f"{row['wrong_done']:.3f}",
    "more CF-SR than as it is": lambda row: paired_text(row["gain"]) if "gain" in row else "",
}


@dataclass(frozen=True)
class CeilingOptions(PolicyInScenes):
    """Evaluate a policy with what it perceives, and with the truth in its place."""


def true_near(scene: OfflineScene) -> OfflineScene:
    """A scene whose perception is never wrong about what is near; of the rest it says the same.

    Raises:
        SceneError: its detections do not say what is near.
    """
    if scene.fields != SCORES:
        raise SceneError(
            f"found {scene.name} with detections of {', '.join(scene.fields) or 'nothing'}, "
            "expected such as the built-in perception makes (cfnav rooms make)"
        )
    detections = np.array(scene.detections)
    detections[:, :, SCORES.index("near")] = scene.visible
    return replace(scene, detections=detections)


def rows(options: CeilingOptions) -> Iterator[dict[str, Any]]:
    """Figures of each of the four evaluations.

    Raises:
        ValueError: policy, scenes or rooms that cannot be used.
    """
    with TemporaryDirectory() as folder:
        known = Path(folder)
        for scene in open_scenes(options.scenes, options.rooms):
            true_near(scene).save(room_folder(known, *parse_room(scene.name)))
        given = {
            "what it perceives": (options.scenes, "own"),
            "the true collision flag": (options.scenes, "true"),
            "the truth of what is near": (known, "own"),
            "both": (known, "true"),
        }
        first = None
        for words, (scenes, p_hat) in given.items():
            found = evaluate(
                options.policy, scenes, options.episodes, options.seed, p_hat=p_hat,
                rooms=options.rooms,
            )  # fmt: skip
            row = {"given": words, "wrong_done": found.wrong_done}
            row |= figures(found.results, found.rooms)
            if first is not None:
                row["gain"] = paired_difference(found, first)
            first = first or found
            yield row


def main(options: CeilingOptions) -> None:
    """Evaluate and print."""
    print(table(COLUMNS, rows(options)))


if __name__ == "__main__":
    sys.exit(run_options("ceiling", CeilingOptions, main))
