"""The model card of a bundle, written from what ``bundle.json`` holds: no figure by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from cfnav_core.models.table import MODELS
from cfnav_core.policy.bundle import BundleHead
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import paired_text

_TABLE = (
    "| bundle | SR | SPL | CF-SR | CF-SPL | collisions per episode |",
    "|---|---|---|---|---|---|",
)

_LISTENING = " The collision probability is also added to its action logits, not in the paper."


def model_card(head: BundleHead) -> str:
    """Markdown for the ``CARD`` of a bundle."""
    t = head.training
    hp, size = t["config"]["hyperparameters"], t["config"]["size"]
    name = t["config"]["model"]
    title = MODELS[name].title if name in MODELS else name
    lines = [
        f"# Model card: {head.name}",
        "",
        f"An object-goal navigation policy (model `{title}`, method "
        f"`{head.method}`) for a robot with {_eyes(head)}. Goals: "
        + ", ".join(head.goals)
        + "."
        + (_LISTENING if t["config"].get("listening") else ""),
        *_other_goals(head),
        "",
        "## How it was made",
        "",
        f"Algorithm 1 at commit `{t['commit']}`, seed {t['config']['seed']}: stage one "
        f"{_stage1(t)}, stage two {hp['stage2_episodes']:,}; the checkpoint "
        f"with the best CF-SR on the validation rooms was kept (after {t['episodes']:,} episodes, "
        f"{t['steps']:,} steps). LSTM widths {size['hidden']} (policy) and "
        f"{t['config']['predictor_hidden']} (collision predictor)."
        + (_foresight(t) if head.feeds_prediction else ""),
        "",
        f"Training rooms: {', '.join(t['train_rooms'])}. Validation rooms: "
        f"{', '.join(t['validation_rooms'])}. {_seen(head)}"
        + (f" The commands stand in {t['commands']}." if "commands" in t else ""),
        "",
        "## What was measured",
        "",
        *(_measured(head) if head.metrics else ["Nothing was measured yet."]),
        "",
        "## What it is not for",
        "",
        f"Trained on rendered rooms only, {_world(head)}. A real robot needs the LiDAR collision "
        "node and its veto; nothing here was measured on hardware.",
        "",
    ]
    return "\n".join(lines)


def _eyes(head: BundleHead) -> str:
    if not head.reads_sightings:
        return f"one RGB camera{_seen_by(head.camera)}"
    return (
        "an object detector on a camera whose field of view is known, and a LiDAR. It reads names, "
        "directions and distances of boxes and no picture, and remembers where each was; it learnt "
        + (f"from a camera{_seen_by(head.camera)}" if head.camera else "from several cameras")
    )


def _seen(head: BundleHead) -> str:
    made = head.training["perception"]
    if head.reads_sightings:
        return f"Sightings: {made}."
    return (
        f"The file of perception `{made}` does not say which rooms it learnt from; for those that "
        "come with cfnav their cards do (`cfnav_core/perception`)."
    )


def _world(head: BundleHead) -> str:
    if head.reads_sightings:
        return "by true boxes with the errors of detectors: another one errs otherwise"
    return "on the view of the camera above: a lower, narrower or fixed one shows another world"


def _stage1(training: dict[str, Any]) -> str:
    """How long it was, and why."""
    ended = training.get("stage1", {}).get("ended")
    if ended is None:
        return f"{training['config']['hyperparameters']['stage1_episodes']:,} episodes"
    return f"{ended:,} episodes (--stage1-most: as long as its predictor gained)"


def _foresight(training: dict[str, Any]) -> str:
    """How good the predictor was, and when: only the rule judges it when it is frozen."""
    stage1 = training.get("stage1", {})
    if not stage1.get("aucs"):
        return ""
    if frozen := stage1["frozen"]:
        return (
            f" The predictor learned from {frozen[0]:,.0f} episodes; its AUC at MoveAheads in the "
            f"validation rooms was {frozen[1]:.3f} when it was frozen."
        )
    episodes, auc = stage1["aucs"][-1]
    return (
        f" At the last validation of stage one, after {episodes:,.0f} episodes, the predictor's "
        f"AUC at MoveAheads in the validation rooms was {auc:.3f}."
    )


def _other_goals(head: BundleHead) -> list[str]:
    others = [name for name in head.objects if head.zero_shot and name not in head.goals]
    if not others:
        return []
    return [
        "",
        f"It also takes goals that it was not trained to find: {', '.join(others)}. How "
        "well it finds them was measured only where figures below say so.",
    ]


def _seen_by(camera: CameraSetUp | None) -> str:
    """Where the camera was and where it looked, as part of a sentence."""
    if camera is None:
        return ""
    wide, high = camera.fov_deg
    view = f"{wide:.0f} degrees" if wide == high else f"{wide:.0f} by {high:.0f} degrees"
    down = [f"{-math.degrees(at):.0f}" for at in camera.horizons[1:]]
    looks = f"tilts {' and '.join(down)} degrees down" if down else "does not tilt"
    return f" at {camera.z:g} m, {view}, that {looks}"


def _measured(head: BundleHead) -> list[str]:
    m = head.metrics
    rows = [_row(head.name, m)]
    if "against" in m:
        rows.append(_row(_name(m["against"]), m["against"]))
    lines = [
        "### Tensor environment",
        "",
        f"Test rooms {_rooms(m['scenes'])}, {m['episodes']} frozen episodes "
        f"(identity `{m['episodes_identity']}`), {_acting(m)}, one training seed. Intervals "
        "are 95 % over rooms, not over seeds.",
        "",
        *_TABLE,
        *rows,
        "",
    ]
    lines += _paired(m)
    if m.get("long"):
        lines += [
            f"Of these, the {m['long']['episodes']} episodes whose best length is 5 actions or "
            f"more: CF-SR {m['long']['cf_sr']:.3f}, SR {m['long']['sr']:.3f}.",
            "",
        ]
    if other := m.get("other_goals"):
        lines += [
            f"Of these, the {other['episodes']} episodes whose goal it was not trained to find: "
            f"CF-SR {other['cf_sr']:.3f}, SR {other['sr']:.3f}.",
            "",
        ]
    lines += [f"Command: `{m['command']}`", "", "| goal | CF-SR | episodes |", "|---|---|---|"]
    by_goal = sorted(m["cf_sr_by_goal"].items(), key=lambda row: -row[1]["cf_sr"])
    lines += [f"| {g} | {row['cf_sr']:.2f} | {row['episodes']} |" for g, row in by_goal]
    return lines + (_live(head.name, m["live"]) if "live" in m else [])


def _acting(m: dict[str, Any]) -> str:
    """How it acted there; older figures do not say, and are of the most probable action."""
    p_hat, actions = m.get("p_hat", "own"), "drawn actions" if m.get("sample") else "argmax"
    heard = {"own": "", "zero": ", without p_hat"}.get(p_hat, f", p_hat {p_hat}")
    return actions + heard + (", the LiDAR may forbid a MoveAhead" if m.get("veto") else "")


def _live(name: str, m: dict[str, Any]) -> list[str]:
    """The trials over the ROS graph: real processes, physics and odometry, LiDAR for p_hat."""
    rows = [_row(name, m)]
    if "against" in m:
        rows.append(_row(_name(m["against"]), m["against"]))
    veto = "on" if m["veto"] else "off"
    pace = f"at most {m['speed']:g} times real time" if m["speed"] else "as fast as it goes"
    if m.get("lock_step"):
        pace = "in lock-step"
    lines = [
        "",
        "### Live ROS graph",
        "",
        f"{m['episodes']} episodes through mock TurtleBot 4, LiDAR collision node and policy node "
        f"in {len(m['rooms'])} test rooms, p_hat from the LiDAR, its veto {veto}, {pace}, "
        f"at commit {', '.join(m['commits'])}; starts at least 5 "
        "actions away. Path lengths in metres.",
        "",
        *_TABLE,
        *rows,
        "",
    ]
    lines += _paired(m)
    return [*lines, f"Command: `{m['command']}`"]


def _paired(m: dict[str, Any]) -> list[str]:
    if "paired" not in m:
        return []
    difference, ends = paired_text(m["paired"]).split(" ", 1)
    return [f"Paired difference in CF-SR: **{difference}** {ends}.", ""]


def _name(m: dict[str, Any]) -> str:
    return Path(m["bundle"]).name if "bundle" in m else Path(m["checkpoint"]).parent.name


def _row(name: str, m: dict[str, Any]) -> str:
    cf_sr = f"{m['cf_sr']:.3f} {ends_text(m['cf_sr_interval'])}"
    return (
        f"| {name} | {m['sr']:.3f} | {m['spl']:.3f} | {cf_sr} | "
        f"{m['cf_spl']:.3f} | {m['collisions_per_episode']:.2f} |"
    )


def _rooms(names: list[str]) -> str:
    """``kitchen 20, 22-25; bedroom 3`` and so on."""
    seeds: dict[str, list[int]] = {}
    others = [name for name in names if ":" not in name]  # of published data
    for name in names:
        kind, colon, seed = name.partition(":")
        if colon:
            seeds.setdefault(kind, []).append(int(seed))
    ours = [f"{kind} {', '.join(_runs(its))}" for kind, its in seeds.items()]
    return "; ".join([*ours, *others])


def _runs(seeds: list[int]) -> list[str]:
    """Seeds in order, those that follow each other as first and last."""
    ends: list[list[int]] = []
    for seed in sorted(seeds):
        if ends and seed == ends[-1][1] + 1:
            ends[-1][1] = seed
        else:
            ends.append([seed, seed])
    return [f"{a}" if a == b else f"{a}-{b}" for a, b in ends]
