"""Judge policies on recorded drives: ``cfnav bag eval BAG... --out DIR``.

Needs no ROS. Reads every bag once, as a stream: judges its drives, replays bundles over them as the
live node would have run them, and watches the sensors. Writes ``report.html``, ``metrics.json``,
``drives.csv``, ``decisions.csv`` and ``health.csv``. Exit code 0: everything was evaluated; 1: some
of it could not be read, replayed or found under the name that was given, and sentences on standard
error name it; 2: nothing was evaluated, or no bag holds a drive.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import tyro

from cfnav_core.command import COULD_NOT, DONE, PARTLY, command_line, run_options
from cfnav_core.policy.bundle import find_bundle
from cfnav_ros.bags.batch import evaluate_all
from cfnav_ros.bags.evaluation import BagEvaluation, JudgeOptions
from cfnav_ros.bags.files.finding import find_bags
from cfnav_ros.bags.files.parameters_file import read_parameters
from cfnav_ros.bags.files.roles import parse_topics
from cfnav_ros.bags.judge.episodes_file import read_episodes
from cfnav_ros.bags.judge.figures import Mean, counted_reasons
from cfnav_ros.bags.results import left_out, result_files
from cfnav_ros.bags.summary import BundleScores, Summary, drives_in, summarise
from cfnav_ros.report.page import figure_text, interval_text, number_text, write_file, write_report

REPORT = "report.html"

FIGURES = {"cf_sr": "cf_sr", "sr": "sr", "cf_spl": "cf_spl", "spl": "spl", "touches": "collisions"}
"""Figures shown in a terminal, by the name there."""

TELLING = ("odom", "cmd_vel", "scan", "hazards", "episode", "truth")
"""Roles of which one makes a drive."""


@dataclass(frozen=True)
class BagEvalConfig:
    """Judge policies on recorded drives, without a robot."""

    bags: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Bags (folders, .mcap or .db3 files), or folders with bags."""
    out: Path = Path("out/bag_eval")
    """Folder of the report and the figures."""
    bundle: tyro.conf.UseAppendAction[tuple[Path, ...]] = ()
    """Bundle to replay, a folder or the name of a shipped one, again for each to compare; when not
    given that which drove, where the bag says it, else the robot's."""
    replay: bool = True
    """Replay bundles; without, only what happened is judged."""
    topic: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """ROLE:=NAME of a topic that has another name than usual, again for each; what is not named is
    found by name or type. Roles: image, scan, odom, cmd_vel, hazards, joint_states, tf, tf_static,
    decision, episode, estimate, truth, map, clock."""
    namespace: str = ""
    """Namespace of the robot in the bags where they hold several, such as robot1; / is one without;
    when not given it is that of the named topics, else the robot of which most is recorded."""
    robot: str = ""
    """The robot: the name of one that is shipped, or its file; topics, LiDAR and limits follow.
    When not given that of --params, else that which a bag says has driven, else turtlebot4_mast."""
    params: Path | None = None
    """ROS parameter file of the robot's nodes; it may name the robot. When neither is given, what
    a bag says its nodes were told."""
    episodes: Path | None = None
    """YAML or CSV file of the drives that no policy node told of: bag, start, end (s), goal, and
    if known goal_x, goal_y (m in the odometry frame), reached."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Bags side by side."""

    def run_command(self) -> int:
        """Evaluate, write and print."""
        return run(self)


def run(config: BagEvalConfig) -> int:
    """Evaluate and write; returns the exit code.

    Raises:
        ValueError: a topic, the episodes file or a bundle cannot be used; one sentence.
        BagError: there is no bag.
        WriteError: a result cannot be written.
    """
    bags, rows = find_bags(config.bags), read_episodes(config.episodes) if config.episodes else ()
    options, unable, lacking = _options(config, bags)
    results = evaluate_all(options, rows, config.jobs)
    done = [result for result in results if isinstance(result, BagEvaluation)]
    failed = [*unable, *(result for result in results if isinstance(result, str))]
    told = lacking + [
        f"{e.name}: {note}"
        for e in done
        for note in (*e.notes, *_not_judged(e), *_not_sure(e), *_not_replayed(e))
    ]
    for sentence in [*failed, *told]:
        print(f"bag_eval: {sentence}", file=sys.stderr)
    if not any(e.events for e in done):
        return COULD_NOT
    summary = summarise(done)
    facts = {"command": command_line(), "bags": str(len(bags))}
    for name, text in result_files(done, summary, facts, failed).items():
        write_file(config.out / name, text)
    write_report(done, config.out / REPORT, facts, summary, failed)
    print(table(done, summary))
    print(f"report in {config.out / REPORT}")
    if not any(e.drives for e in done):
        return COULD_NOT
    whole = [
        isinstance(result, BagEvaluation) and _whole(result, asked)
        for result, asked in zip(results, options.values(), strict=True)
    ]
    return DONE if all(whole) and not unable + lacking else PARTLY


def _options(
    config: BagEvalConfig, bags: Sequence[Path]
) -> tuple[dict[Path, JudgeOptions], list[str], list[str]]:
    """How each bag is to be evaluated; which cannot be, and which without a replay, and why.

    Raises:
        ValueError: what holds for all of them cannot be used; one sentence.
    """
    options_of(config)
    options, unable, lacking = {}, list[str](), list[str]()
    for bag in bags:
        try:
            options[bag] = options_of(replace(config, replay=False), bag)
            options[bag] = options_of(config, bag)
        except ValueError as error:
            if bag in options:  # what drove is on another machine
                lacking.append(f"{bag} is judged without a replay: {error}; name a bundle.")
            else:
                unable.append(f"{bag} could not be evaluated: {error}.")
    return _told_apart(options), unable, lacking


def _told_apart(options: Mapping[Path, JudgeOptions]) -> dict[Path, JudgeOptions]:
    """The same with bundles by names that tell those of all bags apart."""
    given = [folder for of in options.values() for folder in of.bundles.values()]
    paths = {folder: find_bundle(folder).resolve() for folder in given}
    each = [*dict.fromkeys(paths.values())]
    names = dict(zip(each, _names(each), strict=True)) if each else {}
    return {
        bag: replace(of, bundles={names[paths[folder]]: folder for folder in of.bundles.values()})
        for bag, of in options.items()
    }


def _whole(evaluation: BagEvaluation, asked: JudgeOptions) -> bool:
    """Whether everything that was asked of a bag was found in it."""
    lacks_named = any(role in evaluation.missing for role in asked.topics)
    lacks = lacks_named or not evaluation.drives
    return not (evaluation.damaged or lacks or _not_replayed(evaluation))


def _not_judged(evaluation: BagEvaluation) -> list[str]:
    """One sentence about a bag without a drive."""
    if evaluation.drives:
        return []
    used = ", ".join(f"{name} as {role}" for role, name in evaluation.roles.items())
    return [
        f"It holds no drive: expected messages of {', '.join(TELLING)}, under any name or one that "
        f"--topic gives. Used was {used or 'none of its topics'}, left out "
        f"{', '.join(evaluation.unused) or 'nothing'}."
    ]


def _not_sure(evaluation: BagEvaluation) -> list[str]:
    """One sentence for each reason why touches or paths of drives are unknown, or less sure."""
    outcomes = [drive.outcome for drive in evaluation.drives]
    sentences = []
    for what, facts in (
        ("touches are", [o.collisions for o in outcomes]),
        ("the path is", [o.path_length_m for o in outcomes]),
    ):
        for known, word in ((False, "unknown"), (True, "to be taken with care")):
            reasons = counted_reasons(f.why for f in facts if f.why and f.known == known)
            sentences += [
                f"In {count} of {len(facts)} drives {what} {word}: {reason}."
                for reason, count in reasons.items()
            ]
    return sentences


def _not_replayed(evaluation: BagEvaluation) -> list[str]:
    """One sentence about the decisions of a bag that were not replayed, if there are any."""
    outs = left_out(evaluation)
    if not outs or not evaluation.bundles:
        return []
    reasons = [
        f"{count}{f' by {bundle}' if bundle else ''}: {reason.rstrip('.')}"
        for bundle, reason, count in outs
    ]
    total = sum(count for _, _, count in outs)
    return [f"Not replayed were {total} decisions or drives ({'; '.join(reasons)})."]


def table(evaluations: Sequence[BagEvaluation], summary: Summary) -> str:
    """The drives and their figures as lines of text for a terminal."""
    head = ("bag", "goal", "outcome", "reached", "touched", "steps", "m", "driver")
    lines = ["{:<24}{:<15}{:<12}{:<9}{:<9}{:>6}{:>8}  {}".format(*head)]
    for bag, drive in drives_in(evaluations):
        o = drive.outcome
        reached = {True: "yes", False: "no", None: "?"}[o.success.value]
        touched = "?" if o.collisions.value is None else o.collisions.value
        steps = "?" if o.steps is None else o.steps
        lines.append(
            f"{bag.name[:23]:<24}{o.goal or '-':<15}{o.outcome or '-':<12}{reached:<9}"
            f"{touched!s:<9}{steps:>6}{number_text(o.path_length_m.value):>8}  {o.bundle or '-'}"
        )
    lines += _figures(summary.figures)
    for name, figures in summary.drivers.items():
        lines += [f"driver {name or 'not told'}", *_figures(figures)]
    lines += [_line(scores) for scores in summary.bundles]
    return "\n".join(lines)


def _figures(figures: Mapping[str, Mean]) -> list[str]:
    lines = []
    for name, key in FIGURES.items():
        mean = figures[key]
        shown = f"{number_text(mean.value)} {interval_text(mean)}".strip()
        unknown = sum(mean.left_out.values())
        of = f" of {mean.drives + unknown}" if unknown else ""
        lines.append(f"{name:<8}{shown}  ({mean.drives}{of} drives)")
    return lines


def _line(scores: BundleScores) -> str:
    agreed = figure_text(scores.agreement.overall)
    line = f"bundle {scores.name} would have done what was driven: {agreed}"
    own = scores.own
    return f"{line}; {own.equal} of {own.decisions} decisions reproduced" if own.decisions else line


def options_of(config: BagEvalConfig, bag: Path | None = None) -> JudgeOptions:
    """How a bag is to be evaluated: by the robot that is named, else by that which drove.

    Raises:
        ValueError: a topic, a file or a bundle cannot be used; one sentence.
    """
    topics = parse_topics(config.topic)
    told = read_parameters(config.params, config.robot, bag)
    folders = [str(path) for path in config.bundle] or [told.policy.bundle]
    names = _names([find_bundle(folder) for folder in folders])
    bundles = dict(zip(names, folders, strict=True)) if config.replay else {}
    options = JudgeOptions.of(told, topics, bundles=bundles, namespace=config.namespace)
    options.check()
    return options


def _names(folders: Sequence[Path]) -> list[str]:
    """Names by which bundles are told apart: their folders', made longer where they are alike."""
    paths = [folder.resolve() for folder in folders]
    for depth in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    twice = next(path for path in paths if paths.count(path) > 1)
    raise ValueError(f"the bundle {twice} is given twice; expected each once.")


def main() -> int:
    """Entry point of ``ros2 run cfnav_ros bag_eval``; the exit code is ``ending``'s."""
    return run_options("bag_eval", BagEvalConfig)
