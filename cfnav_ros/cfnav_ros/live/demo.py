"""The demo: ``cfnav demo --room kitchen:25 --goals Fridge,Laptop``.

Runs the whole graph, records a bag, judges the bag, compares with what the simulator knows, and
leaves ``metrics.json``, the bag, a picture of each trajectory and ``report.html`` in one folder.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cfnav_core.command import DONE, PARTLY, command_line, run_options
from cfnav_core.detect.labels import load_labels
from cfnav_core.files.provenance import commit
from cfnav_core.policy.bundle import BundleHead, find_bundle
from cfnav_core.policy.goals import refusal
from cfnav_core.policy.networks import reads_room
from cfnav_core.robot.robot import load_robot, simulated
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.limits import step_limit
from cfnav_core.task.rooms import parse_room, type_of
from cfnav_ros.bags.evaluation import BagEvaluation, JudgeOptions, evaluate
from cfnav_ros.bags.files.finding import BagError
from cfnav_ros.bags.files.parameters_file import read_parameters
from cfnav_ros.bags.judge.outcomes import live_outcome
from cfnav_ros.drive.outcome import Outcome, agree, figures, table
from cfnav_ros.live.plan import Trial, chosen_trials, drawn_trials, parse_list
from cfnav_ros.live.run_folder import RunFolder
from cfnav_ros.process.processes import GraphError
from cfnav_ros.report.page import write_report, write_trajectories

if TYPE_CHECKING:
    from cfnav_ros.ros.graph import RosGraph

ROOMS = "kitchen:25,living_room:22,bedroom:23,bathroom:24"
"""Rooms of the demo: test rooms, which training never sees (it uses the seeds 0 to 19)."""

ALL_REFUSED = 2000
"""Trials in a row of goals that were refused before: more than there are goals in all rooms."""

_SIGNS = {(True, True): "✓ reached, nothing touched", (True, False): "✓ reached, but touched"}


@dataclass(frozen=True)
class DemoConfig:
    """Find objects with a simulated TurtleBot 4 over a real ROS 2 graph, and measure it."""

    room: str = ROOMS
    """Rooms, comma-separated, each <type>:<seed>; seeds 20 to 29 were never trained on."""
    goals: str = ""
    """Goals, comma-separated, sought in each room that has them; empty: drawn from the seed."""
    seed: int = 1
    """Draws start poses, and goals when none are given."""
    speed: float = 2.0
    """Simulated seconds per second; 0 is as fast as the machine can, and nothing comes late."""
    out: Path = Path("out/demo")
    """Folder of the results."""
    bundle: Path | None = None
    """Bundle that drives, a folder or the name of a shipped one; when not given that of the robot
    under this camera."""
    episodes: int = 0
    """Number of episodes; 0: one for each room and goal, or one for each room without goals."""
    max_steps: int = 0
    """Most decisions of an episode; 0: 100, and 200 in living rooms."""
    veto: bool = True
    """The LiDAR may forbid a MoveAhead."""
    camera: str = "mast"
    """Camera of the robot: mast, which tilts, stock_preview, stock_wide or lite, as sold, which do
    not, or a JSON file like a scene's camera."""
    depth_down_deg: float | None = None
    """By which a stereo camera looks down, fixed, by whose depth the LiDAR node sees what reaches
    over the LiDAR's plane; 0: it sits where the camera does and tilts with it; not given: there is
    none."""
    detector: str = "shipped"
    """What detects where the bundle reads what a detector says: errors of one on board, shipped or
    a file of them (python -m studies.eyes.errors), or an ONNX file that is run on the pictures."""
    labels: str = "coco"
    """What such an ONNX file learnt: coco, coco_ids, voc, objects365, open_images or a file."""
    domain: int | None = None
    """ROS domain; one that is free when not given."""
    report: bool = True
    """Write pictures and the page."""

    @property
    def drives(self) -> Path:
        """Folder of the bundle."""
        robot = load_robot(simulated(CameraSetUp.read(self.camera).tilts))
        return find_bundle(self.bundle or robot.bundle)

    @property
    def rooms(self) -> tuple[str, ...]:
        """Its rooms; those of the demo when none is named."""
        return parse_list(self.room) or parse_list(ROOMS)

    @property
    def room_type(self) -> str:
        """Of all its rooms; "" when they have several."""
        types = {type_of(parse_room(room)[0]) for room in self.rooms}
        return types.pop() if len(types) == 1 else ""

    def run_command(self) -> int:
        """Run the demo and print what came of it; bag and simulator may disagree (1)."""
        metrics = run_demo(self)
        print(table([Outcome(**row) for row in metrics["episodes"]]))
        print("  ".join(f"{n} {metrics[n]:.2f}" for n in ("cf_sr", "sr", "cf_spl", "spl")))
        agreement = "agrees" if metrics["bag_agrees"] else "DOES NOT AGREE"
        print(f"the bag {agreement} with the simulator; results in {self.out}")
        return DONE if metrics["bag_agrees"] else PARTLY


def known_goals(config: DemoConfig) -> tuple[str, ...]:
    """Return the goals that can be sought; say when the bundle's camera was another.

    They are those that the bundle was trained to find, and what else is asked for that it takes.
    Where an ONNX file detects, its labels must have them.

    Raises:
        BundleError: the bundle cannot be used.
        GraphError: a goal asked for is none of them, or the bundle must know the type of room and
            the rooms have several.
        ValueError: there is no such camera or room.
    """
    head = BundleHead.load(config.drives)
    if reads_room(config.drives) and not config.room_type:
        raise GraphError(
            f"bundle {head.name} looks up what goes with what in a type of room, and the rooms "
            "have several types; run each by itself, such as --room kitchen:25"
        )
    camera = CameraSetUp.read(config.camera)
    if head.camera and not head.reads_sightings and not head.camera.sees_like(camera):
        print(f"bundle {head.name} learnt from a camera of {head.camera}; the robot's is {camera}")
    asked = parse_list(config.goals)
    for why in (refusal(goal, head) for goal in asked):
        if why:
            raise GraphError(f"bundle {head.name}: {why}")
    known = dict.fromkeys((*head.goals, *asked))
    if not (head.reads_sightings and config.detector.endswith(".onnx")):
        return tuple(known)
    names = load_labels(config.labels).categories_said
    if unsaid := [goal for goal in asked if goal not in names]:
        raise GraphError(
            f"a detector with labels {config.labels} never says {', '.join(unsaid)}; ask for other "
            "goals, or give the labels that it learnt"
        )
    return tuple(goal for goal in known if goal in names)


def plan(graph: RosGraph, config: DemoConfig, known: Sequence[str]) -> tuple[Iterator[Trial], int]:
    """Return the trials of a run and how many of them to run.

    Raises:
        GraphError: a room that cannot be made, or a goal that no room has.
    """
    goals = parse_list(config.goals)
    goals_of = {}
    for room in config.rooms:
        answer = graph.start_episode(room, "", config.seed)
        goals_of[room] = tuple(goal for goal in answer.goals if goal in known)
        if not goals_of[room]:
            raise GraphError(f"nothing to find in {room}: {answer.message}")
    if not goals:
        return drawn_trials(goals_of, config.seed), config.episodes or len(goals_of)
    pairs = sum(goal in has for has in goals_of.values() for goal in goals)
    try:
        return chosen_trials(goals_of, goals, config.seed), config.episodes or pairs
    except ValueError as error:
        raise GraphError(str(error)) from None


def run_trials(
    graph: RosGraph,
    config: DemoConfig,
    known: Sequence[str],
    done: Callable[[Trial, Outcome], None],
    skip: Callable[[Trial], bool] = lambda _: False,
) -> None:
    """Run the trials of a configuration one after the other.

    Args:
        graph: the running graph.
        config: what to run.
        known: goals of the bundle.
        done: called with each trial and the simulator's own outcome.
        skip: tells which trials need not be run again; they count.

    Raises:
        GraphError: something did not run, or no goal can be sought: the camera sees it from too
            few places, or no start is far enough away.
    """
    trials, left = plan(graph, config, known)
    print(f"{left} episodes, ROS domain {graph.domain}, logs in {graph.config.logs}", flush=True)
    # chosen goals are sought once in each room that has them, unless a number was asked for
    once = bool(config.goals) and not config.episodes
    refused: dict[tuple[str, str], str] = {}
    ran = idle = 0
    while left:
        trial = next(trials)
        pair = trial.room, trial.goal
        idle += 1
        if pair in refused:
            if idle > ALL_REFUSED:
                raise GraphError(f"no goal can be sought; the last: {refused[pair]}")
            continue
        if not skip(trial):
            start = graph.start_episode(*pair, trial.seed)
            if not start.ok:
                print(f"left out: {start.message}", flush=True)
                refused[pair] = start.message
                left -= once
                continue
            done(trial, run_trial(graph, trial, config.max_steps))
        left -= 1
        ran, idle = ran + 1, 0
    if not ran:
        raise GraphError(f"no goal can be sought; the last: {refused[pair]}")


def run_demo(config: DemoConfig) -> dict[str, Any]:
    """Run the demo and return what stands in ``metrics.json``.

    Raises:
        BundleError: the bundle cannot be used.
        GraphError: the graph did not run.
        BagError: the recorded bag cannot be judged.
        FolderInUseError: another run writes to the same folder.
    """
    # Here, so that the command answers at once to --help and to arguments that make no sense.
    from cfnav_ros.process.graph_config import GraphConfig
    from cfnav_ros.ros.graph import RosGraph

    began = time.monotonic()
    known = known_goals(config)
    live: list[Outcome] = []
    with RunFolder(config.out) as folder:
        bag = folder.partial / "bag"
        graph_config = GraphConfig(
            room=config.rooms[0],
            room_type=config.room_type,
            logs=folder.partial / "logs",
            speed=config.speed,
            lock_step=config.speed == 0,
            bundle=config.bundle,
            veto=config.veto,
            domain=config.domain,
            bag=bag,
            camera=config.camera,
            depth_down_deg=config.depth_down_deg,
            detector=config.detector,
            labels=config.labels,
        )
        with RosGraph(graph_config) as graph:
            run_trials(graph, config, known, lambda _, outcome: live.append(outcome))
        evaluation = evaluate(bag, _options(config, bag))
        metrics = _metrics(config, evaluation, live)
        metrics["wall_s"] = round(time.monotonic() - began, 1)
        if config.report:
            _write_pages(folder.partial, evaluation, metrics)
        (folder.partial / "metrics.json").write_text(json.dumps(metrics, indent=2) + "\n")
        folder.finish()
    return metrics


def run_trial(graph: RosGraph, trial: Trial, max_steps: int = 0) -> Outcome:
    """Drive to the goal under a live line of progress, after ``RosGraph.start_episode``.

    Args:
        graph: the running graph.
        trial: which has begun.
        max_steps: most decisions; 0: as many as ``step_limit`` gives the room.
    """
    max_steps = max_steps or step_limit(type_of(parse_room(trial.room)[0]))
    title = f"{trial.room} {trial.goal}"
    with tqdm(desc=title, bar_format="{desc} [{elapsed}]", leave=False) as line:

        def show(feedback: Any) -> None:
            line.set_description_str(
                f"{title}: step {feedback.step} {feedback.action:<11} "
                f"p̂ {feedback.collision_probability:.2f}  {feedback.path_length:.2f} m"
            )

        outcome = graph.run_episode(trial.room, trial.goal, max_steps, show)
    sign = _SIGNS.get((outcome.success, outcome.cf_success), "✗ missed")
    print(
        f"{title}: {sign} ({outcome.outcome}, {outcome.steps} steps, "
        f"{outcome.path_length_m:.2f} m, collisions {outcome.collisions})"
        + (f": {graph.message}" if outcome.outcome != "done" else ""),
        flush=True,
    )
    return outcome


def _options(config: DemoConfig, bag: Path) -> JudgeOptions:
    """How the bag is judged: for the page, the bundle that drove is asked once more."""
    bundles = {BundleHead.load(config.drives).name: str(config.drives)} if config.report else {}
    return JudgeOptions.of(read_parameters(None, bag=bag), {}, bundles=bundles)


def outcomes_of(evaluation: BagEvaluation) -> list[Outcome]:
    """The outcomes of a simulated robot's episodes, by the truth that its bag holds.

    Raises:
        BagError: the bag holds no episode, or one without its end or ground truth.
    """
    outcomes = [live_outcome(evaluated.drive) for evaluated in evaluation.drives]
    if not outcomes or None in outcomes:
        raise BagError(
            f"{evaluation.name} does not hold every episode with its end and ground truth; "
            "expected policy/episode, policy/decision and ground_truth/state. "
            f"{' '.join(evaluation.notes)}"
        )
    return [outcome for outcome in outcomes if outcome]


def _metrics(
    config: DemoConfig, evaluation: BagEvaluation, live: Sequence[Outcome]
) -> dict[str, Any]:
    outcomes = outcomes_of(evaluation)
    agrees = len(outcomes) == len(live) and all(map(agree, live, outcomes))
    return {
        "episodes": [asdict(outcome) for outcome in outcomes],
        **figures(outcomes),
        "bag_agrees": agrees,
        "live": [asdict(outcome) for outcome in live],
        "seed": config.seed,
        "bundle": evaluation.drives[0].drive.bundle,
        "commit": commit(),
        "command": command_line(),
        "speed": config.speed,
        "camera": config.camera,
    }


def _write_pages(folder: Path, evaluation: BagEvaluation, metrics: dict[str, Any]) -> None:
    write_trajectories(evaluation.drives, folder / "trajectories")
    facts = {
        "bag agrees with the simulator": "yes" if metrics["bag_agrees"] else "no",
        **{name: str(metrics[name]) for name in ("bundle", "seed", "commit", "command")},
    }
    write_report([evaluation], folder / "report.html", facts)


def main() -> int:
    """Entry point of ``ros2 run cfnav_ros demo``; the exit code is ``ending``'s."""
    return run_options("demo", DemoConfig)
