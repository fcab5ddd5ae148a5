"""The page: everything shown, nothing fetched, readable on a phone."""

from __future__ import annotations

import dataclasses
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
from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive, JudgeOptions, evaluate
from cfnav_ros.bags.summary import summarise
from cfnav_ros.report.cards import CARDS, MOMENTS, disagreements_of, with_pictures, words_of
from cfnav_ros.report.page import report_page, write_report, write_trajectories
from cfnav_ros.report.plot_theme import ACTION_STYLE, DARK, LIGHT, TIMES
from cfnav_ros.report.score_plot import CURVES, RELIABILITY, score_png
from cfnav_ros.report.timeline_plot import driven_bars, timeline_png
from cfnav_ros.report.trajectory_plot import course_of, trajectory_png
from PIL import Image

from cfnav_core.task.actions import Action
from studies.bags.bag_files import drive as recorded
from studies.bags.bag_files import write
from tests.bags.evaluations import BUNDLES, by_two_drivers, evaluated, evaluation, made_drive

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-sync", "--disable-background-networking", "--disable-component-update",
    "--allow-file-access-from-files", "--dump-dom", "--virtual-time-budget=10000",
]  # fmt: skip


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages by what they are about."""
    folder = tmp_path_factory.mktemp("pages")
    bag = write(folder / "bag", recorded(6.0))
    about = {
        "two bags": [evaluation("a"), evaluation("b")],
        "long names": [evaluation("drives_of_the_4th_floor_2026-05-25-10-20-15_0"), evaluation()],
        "a real bag": [evaluate(bag, JudgeOptions(bundles={"ours": ""}))],
        "two drivers": by_two_drivers(),
        "no bundle": [bare(evaluation())],
        "no drive": [evaluation(drives=[])],
        "no bag": [],
    }
    for name, evaluations in about.items():
        write_report(evaluations, folder / f"{name}.html", {"seed": "7"})
    return {name: folder / f"{name}.html" for name in about}


def bare(found: BagEvaluation) -> BagEvaluation:
    """The same without bundles, pictures, or anything that tells of contacts."""
    drives = [
        evaluated(dataclasses.replace(d.drive, contacts={}, truths=()), steps=False, pictures=False)
        for d in found.drives
    ]
    return dataclasses.replace(found, drives=tuple(drives), bundles={}, left_out=())


class Page(HTMLParser):
    """Collects tags, addresses, ids and text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.ids: set[str] = set()
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attributes: list) -> None:
        self.tags.append(tag)
        self.addresses += [v for k, v in attributes if k in ("src", "srcset", "href", "action")]
        self.ids |= {v for k, v in attributes if k == "id"}

    def handle_data(self, data: str) -> None:
        self.text += data


def picture(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def share_of(png: bytes, colour: str) -> float:
    """Share of pixels of this colour; a palette may shift it by a shade."""
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return (np.abs(picture(png) - rgb).max(-1) <= 2).mean()


def test_every_page_is_whole_and_fetches_nothing(pages: dict[str, Path]) -> None:
    for path in pages.values():
        html = path.read_text()
        parsed = Page(html)
        inside = [a for a in parsed.addresses if not a.startswith("data:image/")]
        assert {a.removeprefix("#") for a in inside} <= parsed.ids
        assert all(a.startswith("#") for a in inside)
        assert not re.search(r"url\(|@import|<script|<link|<iframe|https?:", html)
        assert parsed.tags.count("main") == 1
        assert "seed" in parsed.text


def test_the_page_holds_every_drive_note_and_finding(pages: dict[str, Path]) -> None:
    parsed = Page(pages["two bags"].read_text())
    assert {f"drive-{n}" for n in range(1, 7)} <= parsed.ids
    assert parsed.tags.count("article") == 6 + len(BUNDLES)
    assert parsed.tags.count("picture") == 2 * 6 + 3 * len(BUNDLES)
    jpegs = sum(a.startswith("data:image/jpeg") for a in parsed.addresses)
    assert jpegs == 6 * 6 + MOMENTS
    for text in (
        "Mug", "<i>&Fridge", "Book", "kitchen:25", "touched Chair at 1.0 s, 0.20 m/s (truth)",
        "<b>&plain: ↻ RotateRight (0.75)", "ours: the same (0.75)", "6 drives: truth",
        "95 %: 0.22 to 0.96", "36 of 36", "</main>/other", "1 gaps without a message",
        "No clearance is taken from it.", "It does not take this goal: <Fridge>.",
        "2 decisions not answered: The bag holds no picture stamped 3.5 s. Likewise the others.",
        "No topic was found for: camera_info.", "Some of this bag could not be read",
        "or its log times where the clocks differ",
        "bump 2", "own decisions of ours", "left out, 4 drives: it touched nothing",
    ):  # fmt: skip
        assert text in re.sub(r"\s+", " ", parsed.text), text


def test_each_driver_has_its_own_figures_when_there_are_several(pages: dict[str, Path]) -> None:
    text = re.sub(r"\s+", " ", Page(pages["two drivers"].read_text()).text)
    assert "Figures by driver" in text
    assert "Driver<i>theirsshipped CF-SR 0.33 95 %: 0.01 to 0.91 3 drives 1.00" in text
    assert "1.00 95 %: 0.03 to 1.00 1 drive SR 0.67" in text
    assert "too few drives for an interval: 3, it takes 20" in text
    assert "Figures by driver" not in pages["two bags"].read_text()


def test_what_is_missing_says_why(pages: dict[str, Path]) -> None:
    text = re.sub(r"\s+", " ", Page(pages["no bundle"].read_text()).text)
    assert "No bundle was replayed" in text
    assert "touches unknown" in text
    assert "the bag holds neither ground truth nor bumps nor odometry with commands" in text
    assert "No source could tell of collisions." in text
    assert "Shortest path: no ground truth, and for the map's way no transform" in text
    assert "None of the pictures of this drive's decisions is in the bag" in text
    assert "where it starts in the map was not recorded" in text
    text = re.sub(r"\s+", " ", Page(pages["no drive"].read_text()).text)
    assert "The bags hold no drive" in text
    assert "missing: the bags hold no drive" in text
    text = re.sub(r"\s+", " ", Page(pages["no bag"].read_text()).text)
    assert "No bag was read." in text


def test_bags_that_failed_are_named() -> None:
    page = report_page([], {}, summarise([]), ["bag7 could not be evaluated: <it> is a folder."])
    assert "bag7 could not be evaluated: &lt;it&gt; is a folder." in page
    assert "1 bag could not be evaluated" in re.sub(r"\s+", " ", page)


def test_a_long_report_stays_light_and_says_so() -> None:
    drives = [made_drive(101 + 10 * i) for i in range(CARDS)]
    late = made_drive(501, "Sofa", reached=False)
    touching = made_drive(511, "Pan", touches=(2.0,))
    found = evaluation(drives=[*drives, late, touching])
    chosen = with_pictures(found.drives)
    assert len(chosen) == CARDS
    assert chosen == {*range(CARDS - 2), CARDS, CARDS + 1}
    page = report_page([found], {}, summarise([found]))
    parsed = Page(page)
    assert f"{CARDS} of {CARDS + 2} drives are shown with pictures" in parsed.text
    assert "drive-22" in parsed.ids
    assert "drive-20" not in parsed.ids
    assert parsed.text.count("Sofa") > 1
    anchors = {a.removeprefix("#") for a in parsed.addresses if a.startswith("#")}
    assert anchors <= parsed.ids
    assert len(page) < CARDS * 300_000


def test_drives_are_judged_in_words() -> None:
    def say(**how: object) -> str:
        return words_of(evaluated(made_drive(**how)).outcome).long

    assert say() == "✓ reached, nothing touched"
    assert say(touches=(1.0, 3.0)) == f"✓ reached, touched 2{TIMES}"
    assert say(reached=False) == "✗ missed"
    assert say(reached=False, touches=(1.0,)) == f"✗ missed, touched 1{TIMES}"
    aimless = dataclasses.replace(made_drive(touches=(1.0,)), goal="")
    assert words_of(evaluated(aimless).outcome).long == (
        f"goal not judged: the drive has no goal, touched 1{TIMES}"
    )


def test_the_surest_disagreements_come_first_each_picture_once() -> None:
    found = evaluation()
    shown = disagreements_of(found.drives)
    assert len(shown) == 9
    assert len({(m.number, m.step.image_ns) for m in shown}) == 9
    assert {m.step.bundle for m in shown} == {"<b>&plain"}
    kept = found.drives[0].pictures
    fewer = dataclasses.replace(found.drives[0], pictures=dict(list(kept.items())[:1]))
    assert len(disagreements_of([fewer])) == 1


def test_collisions_are_red_circles_at_their_place() -> None:
    assert share_of(trajectory_png(evaluated(made_drive())), LIGHT.red) == 0
    assert share_of(trajectory_png(evaluated(made_drive(touches=(3.0,)))), LIGHT.red) > 0.001


def test_themes_differ_in_their_paper() -> None:
    drive = evaluated(made_drive(touches=(1.0,)))
    (scores, _) = summarise([evaluation()]).bundles
    draws: list[Callable] = [
        lambda theme: trajectory_png(drive, theme),
        lambda theme: timeline_png(drive, tuple(BUNDLES), theme),
        *(
            lambda theme, diagram=diagram: score_png(diagram, scores.lidar, scores.rgb, theme)
            for diagram in (RELIABILITY, *CURVES)
        ),
    ]
    for draw in draws:
        assert share_of(draw(LIGHT), LIGHT.paper) > 0.1
        assert share_of(draw(DARK), DARK.paper) > 0.1


def test_the_timeline_shows_actions_that_a_bundle_would_have_taken_instead() -> None:
    drive = evaluated(made_drive())
    right, _ = ACTION_STYLE[Action.RotateRight]
    assert Action.RotateRight not in [bar.action for bar in driven_bars(drive)]
    assert share_of(timeline_png(drive, ("ours",)), right) == 0
    assert share_of(timeline_png(drive, tuple(BUNDLES)), right) > 0.01


def test_inferred_actions_are_shown_when_the_policy_recorded_none() -> None:
    made = evaluated(made_drive())
    without = dataclasses.replace(made, drive=dataclasses.replace(made.drive, decisions=()))
    assert [b.action for b in driven_bars(without)] == [b.action for b in driven_bars(made)]


def place(found: EvaluatedDrive) -> tuple[np.ndarray, tuple, bool, str]:
    course = course_of(found)
    return course.poses, course.contacts, course.room is not None, course.words


def test_a_path_by_odometry_is_drawn_in_the_map_when_the_bag_tells_where() -> None:
    touching = made_drive(touches=(2.0,), with_truth=False)
    _, contacts, in_map, words = place(evaluated(touching))
    assert (in_map, len(contacts)) == (False, 1)
    assert "where it starts in the map was not recorded" in words
    placed = dataclasses.replace(touching, odom_in_map=(1.0, 2.0, np.pi / 2))
    moved, (contact,), in_map, _ = place(evaluated(placed))
    assert in_map
    x, y = touching.path[-1, 1:3]
    assert moved[-1] == pytest.approx([1.0 - y, 2.0 + x, touching.path[-1, 3] + np.pi / 2])
    assert (contact.x, contact.y) == pytest.approx((1.0 - 0.2, 2.0 + 0.2))
    wall = np.column_stack([np.linspace(0, 1, 100), np.full(100, 1.0)])
    lost = dataclasses.replace(evaluated(touching), points=wall)
    assert "grey: what the LiDAR saw" in course_of(lost).words
    assert len(course_of(lost).points) == 100
    assert share_of(trajectory_png(lost), LIGHT.solid) > 0.001
    assert share_of(trajectory_png(evaluated(touching)), LIGHT.solid) == 0
    assert "no map" in place(evaluated(dataclasses.replace(touching, map=None)))[3]


def test_a_drive_without_any_pose_still_has_its_pictures() -> None:
    nothing = made_drive(with_truth=False)
    nothing = dataclasses.replace(
        nothing, path=np.empty((0, 4)), estimates=np.empty((0, 4)), decisions=(), map=None
    )
    found = evaluated(nothing, steps=False)
    assert picture(trajectory_png(found)).size
    assert picture(timeline_png(found, ())).size


def test_one_png_of_each_trajectory(tmp_path: Path) -> None:
    drives = [evaluated(made_drive()), evaluated(made_drive(goal="a/b", with_truth=False))]
    paths = write_trajectories(drives, tmp_path / "pictures")
    assert [p.name for p in paths] == ["01_kitchen25_Mug.png", "02_a-b.png"]
    assert picture(paths[0].read_bytes()).shape[1] > 500


def dom_of(page: Path, flags: list[str], folder: Path) -> str:
    """What a browser makes of a page; one that hangs is ended whole and tried again."""
    for attempt in range(3):
        command = [CHROMIUM, *flags, f"--user-data-dir={folder / f'profile{attempt}'}"]
        browser = subprocess.Popen(
            [*command, page.as_uri()], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, start_new_session=True,
        )  # fmt: skip
        try:
            return browser.communicate(timeout=300)[0]
        except subprocess.TimeoutExpired:
            os.killpg(browser.pid, signal.SIGKILL)
            browser.communicate()
    raise TimeoutError(f"{CHROMIUM} hung three times")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_pages_fit_the_window_of_a_browser(
    pages: dict[str, Path], tmp_path: Path, width: int, dark: bool
) -> None:
    # Frames have exactly the width asked for; the window itself cannot be as narrow as a phone.
    frames = "".join(
        f'<iframe src="{path.as_uri()}" style="width:{width}px;height:900px"></iframe>'
        for path in pages.values()
    )
    probe = tmp_path / "probe.html"
    probe.write_text(
        f"{frames}<script>onload=()=>{{document.title=[...document.querySelectorAll('iframe')].map("
        "f=>{const d=f.contentDocument;[...d.images].forEach(i=>i.loading='eager');"
        "d.querySelectorAll('details').forEach(e=>e.open=true);return ["
        "d.documentElement.scrollWidth,"
        "[...d.images].filter(i=>!i.complete||!i.naturalWidth).length,d.images.length,"
        "f.contentWindow.getComputedStyle(d.body).backgroundColor.replaceAll(' ',''),"
        # tables that are cut, and rows of tiles that are not full
        "[...d.querySelectorAll('.table')].filter(t=>t.scrollWidth>t.clientWidth).length,"
        "[...d.querySelectorAll('.figures>*')].map(t=>t.getBoundingClientRect())"
        ".filter((t,i,all)=>!all[i+1]||all[i+1].top>t.top).filter(t=>"
        "Math.abs(d.querySelector('.figures').getBoundingClientRect().right-t.right)>1).length"
        "].join(' ')}).join(';')}</script>"
    )
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    dom = dom_of(probe, [*FLAGS, scheme], tmp_path)
    found = [row.split() for row in re.search(r"<title>(.*?)</title>", dom).group(1).split(";")]
    paper = "rgb(18,20,24)" if dark else "rgb(244,243,239)"
    assert len(found) == len(pages)
    for (scroll, broken, images, background, cut, ragged), path in zip(
        found, pages.values(), strict=True
    ):
        assert int(scroll) <= width, path
        assert int(cut) == 0 or width < 992, path
        assert int(ragged) == 0, path
        assert (int(broken), background) == (0, paper), path
        assert int(images) == Page(path.read_text()).tags.count("img"), path
