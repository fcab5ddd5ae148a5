"""Evaluations of bags by hand, small but with everything that a report shows."""

import dataclasses
import io

import numpy as np
from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive
from cfnav_ros.bags.files.events import OccupancyMap
from cfnav_ros.bags.health.health import Finding
from cfnav_ros.bags.health.topic_watch import TopicHealth
from cfnav_ros.bags.judge.contacts import BUMP, CLEARANCE, STALL, TRUTH, Contact
from cfnav_ros.bags.judge.drive_log import Drive
from cfnav_ros.bags.judge.outcomes import counted_contacts, judge
from cfnav_ros.bags.replay.step import LeftOut, labelled
from PIL import Image

from cfnav_core.task.actions import Action
from tests.bags.made import S, at, decided, ns, truth
from tests.bags.steps import step_of

A = Action
ACTIONS = (A.MoveAhead, A.RotateLeft, A.MoveAhead, A.LookDown, A.MoveAhead, A.Done)
BUNDLES = {"ours": "shipped", "<b>&plain": "plain"}


def jpeg(shade=128):
    buffer = io.BytesIO()
    Image.new("RGB", (24, 24), (shade, 255 - shade, 40)).save(buffer, format="JPEG")
    return buffer.getvalue()


def room():
    occupied = np.zeros((60, 80), bool)
    occupied[[0, -1], :] = occupied[:, [0, -1]] = True
    return OccupancyMap(**at(1), occupied=occupied, resolution=0.05, origin=(-1.0, -1.0))


def made_drive(begin=101.0, goal="Mug", reached=True, touches=(), with_truth=True):
    """A drive of six decisions, one a second; ``touches`` are seconds from its start."""
    times = [begin + 0.5 + i for i in range(len(ACTIONS))]
    path = np.array([(0.5 * i, 0.1 * i, 0.2 * np.sin(i), 0.1 * i) for i in range(14)])
    truths = [
        truth(begin + t, x, y, sum(t >= touch for touch in touches), reached and t > 5, goal)
        for t, x, y, _ in path
    ]
    touched = [Contact(ns(begin + t), 0.1 * t, 0.2, "Chair", source=TRUTH, speed=0.2)
               for t in touches]  # fmt: skip
    felt = [dataclasses.replace(c, source=BUMP, contact_with="bump_front_left") for c in touched]
    score = 0.9 if reached else 0.1
    return Drive(
        found="policy", start_ns=ns(begin), end_ns=ns(begin + 6.8), goal=goal, bundle="shipped",
        outcome="done", message="The policy says that it sees it.", path=path, path_length_m=1.3,
        decisions=tuple(decided(t, i + 1, a, score, vetoed=i == 2, goal=goal)
                        for i, (t, a) in enumerate(zip(times, ACTIONS, strict=True))),
        contacts={**({TRUTH: tuple(touched)} if with_truth else {}), BUMP: tuple(felt), STALL: (),
                  CLEARANCE: ()},
        estimates=np.array([(0.2 * i, 0.02 * i, 1.0, 2 * (i == 9)) for i in range(30)]),
        clearance_m=0.3, truths=tuple(truths) if with_truth else (),
        truth_length_m=1.3 if with_truth else None, map=room(),
    )  # fmt: skip


def answers(drive, bag="bag"):
    """Both bundles' answers: the second would turn right where a MoveAhead was driven."""
    steps = []
    ends = [*(d.t_ns for d in drive.decisions[1:]), drive.end_ns]
    for decision, end in zip(drive.decisions, ends, strict=True):
        for name in BUNDLES:
            other = name != "ours" and decision.action is A.MoveAhead
            own = A.RotateRight if other else decision.action
            p = np.full(6, 0.05, np.float32)
            p[own] = 0.75
            steps.append(step_of(
                bag=bag, bundle=name, driver=drive.bundle, drive_ns=drive.start_ns,
                goal=drive.goal, step=decision.step, t_ns=decision.t_ns, until_ns=end,
                image_ns=decision.image_ns, driven=decision.action,
                driven_vetoed=decision.vetoed, driven_probabilities=p,
                driven_p_hat=0.05 + 0.1 * decision.step,
                action=own, probabilities=p, p_hat=0.05 + 0.1 * decision.step,
                p_hat_lidar=0.05 + 0.1 * decision.step,
                p_hat_rgb=0.6 - 0.1 * decision.step,
            ))  # fmt: skip
    return steps


def evaluated(drive, bag="bag", steps=True, pictures=True):
    outcome, contacts = judge(drive), counted_contacts(drive)
    made = labelled(answers(drive, bag), [c.t_ns for c in contacts]) if steps else []
    shown = {d.image_ns: jpeg(20 * d.step) for d in drive.decisions} if pictures else {}
    return EvaluatedDrive(drive, outcome, contacts, tuple(made), shown)


def evaluation(name="bag", drives=None, **changes):
    """A bag of a clean, a touching and a missed drive, replayed with two bundles."""
    if drives is None:
        drives = [
            made_drive(101), made_drive(111, "<i>&Fridge", touches=(1.0, 3.0)),
            made_drive(121, "Book", reached=False),
        ]  # fmt: skip
    made = BagEvaluation(
        name=name, seconds=30.0, events=1000, roles={"image": "/image", "scan": "/scan"},
        missing=("camera_info",), drives=tuple(evaluated(d, name) for d in drives),
        left_out=(LeftOut("", 101 * S, 3, 104 * S, "The bag holds no picture stamped 3.5 s."),
                  LeftOut("", 101 * S, 4, 105 * S, "The bag holds no picture stamped 4.5 s."),
                  LeftOut("ours", 111 * S, 1, 111 * S, "It does not take this goal: <Fridge>.")),
        topics=(TopicHealth("/scan", "LaserTurn", 200, 0.1, 29.0, 1.5, {}),
                TopicHealth("/tf_static", "Frames", 1, 0.1, 0.1),
                TopicHealth("/estimate", "Judged", 200, 0.1, 29.0, 1.5, {"GOOD": 25.0})),
        findings=(Finding("gap", "/scan", 3.0, 4.5, "1 gaps without a message, the longest of "
                          "1.50 s.", "No clearance is taken from it."),),
        notes=("For image /image was chosen, there are also </main>/other.",), damaged=True,
        bundles=BUNDLES,
    )  # fmt: skip
    return dataclasses.replace(made, **changes)


def by_two_drivers():
    """A clean drive of one driver and, in another bag, a missed and a touching one of another."""
    ours = [made_drive(101)]
    theirs = [made_drive(101, reached=False), made_drive(111, touches=(1.0,)), made_drive(121)]
    theirs = [dataclasses.replace(drive, bundle="<i>theirs") for drive in theirs]
    return [evaluation("a", ours), evaluation("b", theirs)]
