"""The page: everything shown, nothing fetched, readable on a phone."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from cfnav_ros.bag_eval import evaluate_bag
from cfnav_ros.bag_reader import read_maps
from cfnav_ros.outcome import Episode
from cfnav_ros.report import key_decisions, map_of, write_report, write_trajectories
from cfnav_ros.trajectory_plot import DARK, LIGHT, timeline_png, trajectory_png
from PIL import Image

from cfnav_core.actions import Action

A = Action
DRIVE = [A.MoveAhead] * 12 + [A.RotateLeft, A.MoveAhead, A.LookDown, A.RotateRight, A.Done]
S = 1_000_000_000
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture
def bag(synthetic_bag: Callable) -> Path:
    """A bag of a clean and a touching episode."""
    writer = synthetic_bag()
    writer.map(S // 2)
    t = writer.episode(S, DRIVE)
    writer.episode(t, DRIVE, goal="<b>&Fridge", touch=(4, 9), outcome="step_limit")
    writer.writer.close()
    return writer.path


@pytest.fixture
def page(bag: Path, tmp_path: Path) -> Path:
    """The page about the bag."""
    html = tmp_path / "report.html"
    write_report(bag, evaluate_bag(bag), read_maps(bag), html, {"seed": "7"})
    return html


class Page(HTMLParser):
    """Collects tags, addresses and text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attributes: list) -> None:
        self.tags.append(tag)
        self.addresses += [v for k, v in attributes if k in ("src", "srcset", "href", "action")]

    def handle_data(self, data: str) -> None:
        self.text += data


def picture(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def share_of(png: bytes, colour: str) -> float:
    """Share of pixels of exactly this colour."""
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return (picture(png) == rgb).all(-1).mean()


def test_page_holds_every_episode_and_fetches_nothing(page: Path) -> None:
    html = page.read_text()
    parsed = Page(html)
    outside = [a for a in parsed.addresses if not a.startswith(("data:image/", "#episode-"))]
    assert outside == []
    assert not re.search(r"url\(|@import|<script|<link|<iframe", html)
    assert parsed.tags.count("article") == 2
    assert parsed.tags.count("picture") == 4
    assert sum(a.startswith("data:image/jpeg") for a in parsed.addresses) == 16
    for text in ("Laptop", "kitchen:25", "<b>&Fridge", "step_limit", "touched Chair", "seed"):
        assert text in parsed.text


def test_key_pictures_hold_first_last_and_those_of_collisions(bag: Path) -> None:
    episode = evaluate_bag(bag)[1]
    steps = [d.step for d in key_decisions(episode)]
    assert len(steps) == 8
    assert {1, 4, 9, len(DRIVE)} <= set(steps)
    assert steps == sorted(steps)


def test_collisions_are_red_circles_at_their_place(bag: Path) -> None:
    clean, touching = evaluate_bag(bag)
    (room,) = read_maps(bag)
    assert share_of(trajectory_png(clean, room), LIGHT.red) == 0
    assert share_of(trajectory_png(touching, room), LIGHT.red) > 0.001


def test_themes_differ_in_their_paper(bag: Path) -> None:
    episode = evaluate_bag(bag)[0]
    for draw in (timeline_png, lambda e, theme: trajectory_png(e, None, theme)):
        assert share_of(draw(episode, LIGHT), LIGHT.paper) > 0.2
        assert share_of(draw(episode, DARK), DARK.paper) > 0.2


def test_map_is_the_last_one_before_the_episode(synthetic_bag: Callable) -> None:
    writer = synthetic_bag()
    writer.map(1, size=150)
    t = writer.episode(S, DRIVE)
    writer.map(t, size=200)
    writer.episode(t + S, DRIVE)
    writer.writer.close()
    maps = read_maps(writer.path)
    sizes = [map_of(e, maps).occupied.shape[0] for e in evaluate_bag(writer.path)]
    assert sizes == [150, 200]


def test_one_png_of_each_trajectory(bag: Path, tmp_path: Path) -> None:
    episodes: tuple[Episode, ...] = evaluate_bag(bag)
    paths = write_trajectories([episodes[0]], read_maps(bag), tmp_path / "pictures")
    assert [p.name for p in paths] == ["01_kitchen25_Laptop.png"]
    assert picture(paths[0].read_bytes()).shape[0] > 500


def dom_of(page: Path, flags: list[str], folder: Path) -> str:
    """What a browser makes of a page; one that hangs is ended whole and tried again."""
    for attempt in range(3):
        command = [CHROMIUM, *flags, f"--user-data-dir={folder / f'profile{attempt}'}"]
        browser = subprocess.Popen(
            [*command, page.as_uri()], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, start_new_session=True,
        )  # fmt: skip
        try:
            return browser.communicate(timeout=60)[0]
        except subprocess.TimeoutExpired:
            os.killpg(browser.pid, signal.SIGKILL)
            browser.communicate()
    raise TimeoutError(f"{CHROMIUM} hung three times")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
@pytest.mark.parametrize("width", [390, 1280])
def test_page_fits_the_window_of_a_browser(page: Path, tmp_path: Path, width: int) -> None:
    # A frame has exactly the width asked for; the window itself cannot be as narrow as a phone.
    probe = tmp_path / "probe.html"
    probe.write_text(
        f'<iframe id="f" src="{page.name}" style="width:{width}px;height:900px"></iframe><script>'
        "f.onload=()=>{const d=f.contentDocument;document.title=["
        "d.documentElement.scrollWidth,"
        "[...d.images].filter(i=>!i.complete||!i.naturalWidth).length,"
        "d.images.length].join(' ')}</script>"
    )
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-sync",
        "--disable-background-networking",
        "--disable-component-update",
        "--allow-file-access-from-files",
    ]
    flags += ["--dump-dom", "--virtual-time-budget=10000"]
    title = re.search(r"<title>(.*?)</title>", dom_of(probe, flags, tmp_path)).group(1)
    scroll, broken, images = map(int, title.split())
    assert scroll <= width
    assert (broken, images) == (0, 20)
