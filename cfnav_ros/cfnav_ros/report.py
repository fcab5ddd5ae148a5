"""One self-contained HTML page about a bag: ``python -m cfnav_ros.report BAG --html FILE``.

Needs no ROS and no network, neither to write the page nor to read it.
"""

from __future__ import annotations

import base64
import io
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from jinja2 import Environment, PackageLoader, StrictUndefined
from PIL import Image

from cfnav_ros.bag_eval import evaluate_bag, figures
from cfnav_ros.bag_reader import BagError, RoomMap, read_maps, read_pictures
from cfnav_ros.outcome import Decision, Episode
from cfnav_ros.trajectory_plot import ACTION_STYLE, THEMES, timeline_png, trajectory_png

FRAMES = 8
"""Camera pictures shown of each episode."""


@dataclass(frozen=True)
class Frame:
    """One camera picture of the strip with the decision taken on it."""

    uri: str
    decision: Decision
    sign: str
    note: str


@dataclass(frozen=True)
class Card:
    """Everything the page shows of one episode; pictures as data URIs by theme."""

    number: int
    episode: Episode
    trajectory: Mapping[str, str]
    timeline: Mapping[str, str]
    frames: Sequence[Frame]


def key_decisions(episode: Episode, count: int = FRAMES) -> list[Decision]:
    """Choose the decisions worth a picture.

    First and last, those before each collision, the vetoed, the most probable collision; the rest
    evenly spaced.
    """
    decisions = list(episode.decisions)
    if len(decisions) <= count:
        return decisions
    chosen = {0, len(decisions) - 1}
    for contact in episode.contacts:
        chosen.add(max((i for i, d in enumerate(decisions) if d.t_ns <= contact.t_ns), default=0))
    chosen.add(max(range(len(decisions)), key=lambda i: decisions[i].collision_probability))
    chosen.update(i for i, d in enumerate(decisions) if d.vetoed)
    last = len(decisions) - 1
    chosen = {0, last, *sorted(chosen - {0, last})[: count - 2]}
    gaps = (round(i) for i in np.linspace(0, last, count))
    for index in gaps:
        if len(chosen) < count:
            chosen.add(index)
    return [decisions[i] for i in sorted(chosen)]


def write_trajectories(
    episodes: Sequence[Episode], maps: Sequence[RoomMap], folder: Path
) -> list[Path]:
    """Write one PNG of each trajectory into a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, episode in enumerate(episodes, 1):
        name = f"{number:02d}_{episode.outcome.room.replace(':', '')}_{episode.goal}.png"
        (folder / name).write_bytes(trajectory_png(episode, map_of(episode, maps)))
        paths.append(folder / name)
    return paths


def write_report(
    bag: Path,
    episodes: Sequence[Episode],
    maps: Sequence[RoomMap],
    html: Path,
    facts: Mapping[str, str],
) -> None:
    """Write the page.

    Args:
        bag: where the camera pictures are read from.
        episodes: the judged episodes of the bag.
        maps: the room maps of the bag.
        html: file to write.
        facts: what else stands under the title, such as seed, commit, command.
    """
    wanted = {e.start_ns: key_decisions(e) for e in episodes}
    stamps = {d.image_ns for chosen in wanted.values() for d in chosen}
    pictures = read_pictures(bag, stamps)
    cards = [
        Card(
            number=number,
            episode=episode,
            trajectory={
                name: _uri(trajectory_png(episode, map_of(episode, maps), theme), "png")
                for name, theme in THEMES.items()
            },
            timeline={
                name: _uri(timeline_png(episode, theme), "png") for name, theme in THEMES.items()
            },
            frames=_frames(episode, wanted[episode.start_ns], pictures),
        )
        for number, episode in enumerate(episodes, 1)
    ]
    templates = Environment(
        loader=PackageLoader("cfnav_ros"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = templates.get_template("report.html").render(
        cards=cards,
        figures=figures([e.outcome for e in episodes]),
        facts=facts,
        legend=[(a.name, *style) for a, style in ACTION_STYLE.items()],
    )
    html.write_text(page, encoding="utf-8")


def map_of(episode: Episode, maps: Sequence[RoomMap]) -> RoomMap | None:
    """Return the map that was valid when the episode started, or None when the bag holds none."""
    before = [m for m in maps if m.t_ns <= episode.start_ns]
    return before[-1] if before else None


def _frames(
    episode: Episode, chosen: Sequence[Decision], pictures: Mapping[int, np.ndarray]
) -> list[Frame]:
    frames = []
    following = [*episode.decisions[1:], None]
    until = {
        d.step: n.t_ns if n else episode.end_ns
        for d, n in zip(episode.decisions, following, strict=True)
    }
    for decision in chosen:
        if decision.image_ns not in pictures:
            continue
        touched = any(decision.t_ns <= c.t_ns < until[decision.step] for c in episode.contacts)
        note = "touched" if touched else "vetoed" if decision.vetoed else ""
        sign = ACTION_STYLE[decision.action][1]
        frames.append(Frame(_jpeg(pictures[decision.image_ns]), decision, sign, note))
    return frames


def _jpeg(rgb: np.ndarray) -> str:
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgb)).save(buffer, format="JPEG", quality=80)
    return _uri(buffer.getvalue(), "jpeg")


def _uri(data: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def report(bag: Annotated[Path, tyro.conf.Positional], html: Path = Path("report.html")) -> None:
    """Write one self-contained HTML page about a recorded bag.

    Args:
        bag: folder of the bag, or its .mcap file.
        html: the file to write.
    """
    write_report(bag, evaluate_bag(bag), read_maps(bag), html, {"bag": bag.name})
    print(html)


def main() -> None:
    """Run the command line; a bag that cannot be judged ends it with one sentence and code 2."""
    try:
        tyro.cli(report, prog="report")
    except BagError as error:
        print(f"report: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
