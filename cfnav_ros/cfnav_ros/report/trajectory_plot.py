"""The picture of one drive from above: the recorded map, the driven path, the contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from cfnav_core.task.visibility import VISIBLE_DISTANCE_M
from cfnav_ros.bags.evaluation import EvaluatedDrive
from cfnav_ros.bags.files.events import OccupancyMap
from cfnav_ros.bags.judge.contacts import TRUTH, Contact
from cfnav_ros.bags.judge.drive_log import moved
from cfnav_ros.report.plot_theme import GREEN, LIGHT, ORANGE, Theme, png, style

HULL_RADIUS_M = 0.175
NOT_PLACED = "where it starts in the map was not recorded"
VIEW_DEG = 90.0
"""Horizontal field of view of the camera that the policy is trained with, degrees."""

MOST_CELLS = 1000
"""Of a map's longer side in the picture; finer ones are drawn coarser, walls kept."""

ROOM_M, AROUND_M = 12.0, 2.5
"""A larger map is shown so far around the path; a smaller one whole."""

_SAME_PLACE_M = 0.25
"""Marks of contacts nearer than this would cover each other."""


@dataclass(frozen=True)
class Course:
    """What is drawn of a drive, all in one frame.

    Attributes:
        poses: float64 [N, 3]: x, y (m), yaw (rad).
        contacts: where they are known.
        room: the map in the same frame, None without.
        points: float32 [N, 2], what the LiDAR saw around, metres; only without a map.
        words: what is drawn, for the caption; part of a sentence.
    """

    poses: np.ndarray
    contacts: tuple[Contact, ...]
    room: OccupancyMap | None
    words: str
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))


def course_of(evaluated: EvaluatedDrive) -> Course:
    """Put path, contacts and map of a drive into one frame.

    The simulator's truth is in the room's frame, as its map; odometry needs the transform to the
    map that the bag recorded, and is drawn over what the LiDAR saw where there is none.
    """
    drive, points = evaluated.drive, np.empty((0, 2))
    if drive.truths:
        poses = np.array([(s.x, s.y, s.yaw) for s in drive.truths])
        placed = [c for c in evaluated.contacts if c.source == TRUTH]
        room = drive.map
        words = "true path" + ("" if room else "; the bag holds no map")
    else:
        poses, placed = drive.path[:, 1:], list(evaluated.contacts)
        if drive.map is not None and drive.odom_in_map is not None:
            room, words = drive.map, "path by odometry, as the robot placed it in its map"
            poses = moved(poses, drive.odom_in_map)
            felt = moved(
                np.array([(c.x, c.y, 0.0) for c in placed]).reshape(-1, 3), drive.odom_in_map
            )
            placed = [replace(c, x=x, y=y) for c, (x, y, _) in zip(placed, felt, strict=True)]
        else:
            room, points = None, evaluated.points
            seen = "; grey: what the LiDAR saw" if len(points) else ""
            lack = "the bag holds no map" if drive.map is None else NOT_PLACED
            words = f"path by odometry{seen}; {lack}"
    known = tuple(c for c in placed if math.isfinite(c.x) and math.isfinite(c.y))
    return Course(poses, known, room, words, points)


def trajectory_png(evaluated: EvaluatedDrive, theme: Theme = LIGHT) -> bytes:
    """Draw the room from above with start, path, contacts and the last pose; returns a PNG file.

    Args:
        evaluated: the drive; one without any pose gives an empty picture.
        theme: light or dark.
    """
    course = course_of(evaluated)
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(6, 6), facecolor=theme.paper)
        axes = figure.add_subplot()
        draw_plan(axes, course, bool(evaluated.outcome.success.value), theme)
        style(axes, theme)
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        if course.room is None:
            axes.margins(0.05 if len(course.points) else 0.3)
        return png(figure, bbox_inches="tight", pad_inches=0.04)


def draw_plan(axes: Axes, course: Course, success: bool, theme: Theme) -> None:
    """Draw what a course holds; ``success`` colours its last pose."""
    if course.room is not None and course.room.occupied.size:
        draw_room(axes, course.room, theme)
        show_around(axes, course)
    axes.plot(*course.points.T, "s", color=theme.solid, ms=2.5, mew=0, zorder=1)
    draw_path(axes, course.poses, theme)
    if len(course.poses):
        draw_ends(axes, course.poses, success, theme)
    for contact in merged(course.contacts):
        draw_contact(axes, contact, theme)
    axes.set_aspect("equal")


def draw_room(axes: Axes, room: OccupancyMap, theme: Theme) -> None:
    """Draw what of a map is occupied."""
    every = math.ceil(max(room.occupied.shape) / MOST_CELLS)
    height, width = room.occupied.shape
    tall, wide = -(-height // every), -(-width // every)
    cells = np.zeros((tall * every, wide * every), bool)
    cells[:height, :width] = room.occupied
    coarse = cells.reshape(tall, every, wide, every).any((1, 3))
    (x, y), size = room.origin, room.resolution * every
    axes.imshow(
        coarse,
        cmap=ListedColormap([theme.floor, theme.solid]),
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(x, x + wide * size, y, y + tall * size),
        interpolation="nearest",
    )


def show_around(axes: Axes, course: Course) -> None:
    """Show the map, of a large one what lies around the path."""
    room = course.room
    assert room is not None
    extent = np.array(room.occupied.shape[::-1]) * room.resolution
    low, high = np.array(room.origin), np.array(room.origin) + extent
    if len(course.poses):
        first, last = course.poses[:, :2].min(0), course.poses[:, :2].max(0)
        if extent.max() > ROOM_M:
            low, high = np.maximum(low, first - AROUND_M), np.minimum(high, last + AROUND_M)
        # A path that leaves its map is shown whole all the same.
        low, high = np.minimum(low, first - HULL_RADIUS_M), np.maximum(high, last + HULL_RADIUS_M)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def draw_path(axes: Axes, poses: np.ndarray, theme: Theme) -> None:
    """Draw places, float64 [N, 2 or more] in metres, from light to dark as time goes on."""
    if len(poses) < 2:
        return
    segments = list(np.stack([poses[:-1, :2], poses[1:, :2]], axis=1))
    colours = LinearSegmentedColormap.from_list("time", [theme.early, theme.late])
    lines = LineCollection(segments, cmap=colours, linewidths=3, capstyle="round", zorder=3)
    lines.set_array(np.linspace(0, 1, len(segments)))
    axes.add_collection(lines)


def draw_ends(axes: Axes, poses: np.ndarray, success: bool, theme: Theme) -> None:
    """Mark the start with an S, the last pose with hull, heading and viewing cone."""
    (x0, y0, _), (x, y, yaw) = poses[0], poses[-1]
    colour = GREEN if success else ORANGE
    cone = math.degrees(yaw)
    axes.add_patch(
        Wedge(
            (x, y),
            VISIBLE_DISTANCE_M,
            cone - VIEW_DEG / 2,
            cone + VIEW_DEG / 2,
            facecolor=colour,
            alpha=0.3,
            zorder=2,
        )
    )
    axes.add_patch(Circle((x0, y0), HULL_RADIUS_M, fill=False, color=theme.ink, lw=1.5, zorder=4))
    axes.text(x0, y0, "S", color=theme.ink, ha="center", va="center", weight="bold", zorder=5)
    axes.add_patch(Circle((x, y), HULL_RADIUS_M, color=colour, zorder=4))
    tip = HULL_RADIUS_M * np.array([math.cos(yaw), math.sin(yaw)])
    axes.plot([x, x + tip[0]], [y, y + tip[1]], color="black", lw=2, zorder=5)


def draw_contact(axes: Axes, contact: Contact, theme: Theme) -> None:
    """Mark collisions at one place with a red circle around their count."""
    axes.text(
        contact.x,
        contact.y,
        str(contact.count),
        color="white" if theme is LIGHT else "black",
        ha="center",
        va="center",
        weight="bold",
        zorder=7,
        bbox={"boxstyle": "circle,pad=0.4", "fc": theme.red, "ec": "white", "lw": 1},
    )


def merged(contacts: Sequence[Contact]) -> list[Contact]:
    """Join contacts at the same place so that their marks do not cover each other."""
    places: list[Contact] = []
    for contact in contacts:
        for i, place in enumerate(places):
            if math.hypot(contact.x - place.x, contact.y - place.y) < _SAME_PLACE_M:
                places[i] = replace(place, count=place.count + contact.count)
                break
        else:
            places.append(contact)
    return places
