"""scripts/train_demo.sh with commands that only say that they were called."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cfnav_core.task.camera import CameraSetUp

SCRIPT = Path(__file__).parents[1] / "scripts/train_demo.sh"
STUB = """#!/bin/sh
case "$1" in -c) exec {python} "$@" ;; esac
echo "$(basename "$0") $*" >> {calls}
case "$*" in {fails}*) [ ! -e {broken} ] || exit 1 ;; esac
"""


class Demo:
    """Runs the script; ``breaks`` are the words that a failing command begins with."""

    def __init__(self, folder: Path, breaks: str) -> None:
        self.folder, self.calls, self.broken = folder, folder / "calls", folder / "broken"
        for name in ("cfnav", "python"):
            stub = folder / "bin" / name
            stub.parent.mkdir(exist_ok=True)
            stub.write_text(STUB.format(
                python=sys.executable, calls=self.calls, broken=self.broken,
                fails=breaks.replace(" ", "\\ "),
            ))  # fmt: skip
            stub.chmod(0o755)

    def run(self, bundles: str, **settings: str) -> tuple[int, list[str], str]:
        """Exit code, the commands called, and what was said of errors."""
        self.calls.write_text("")
        env = os.environ | settings | {
            "BUNDLES": bundles, "OUT": str(self.folder / "out"),
            "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
        }  # fmt: skip
        done = subprocess.run(["bash", SCRIPT], env=env, capture_output=True, text=True)
        return done.returncode, self.calls.read_text().splitlines(), done.stderr


@pytest.fixture
def demo(tmp_path: Path) -> Demo:
    return Demo(tmp_path, "evaluate")


def test_what_is_done_is_not_done_again(demo: Demo) -> None:
    code, calls, _ = demo.run("boxes")
    assert code == 0
    said = [call.split()[1:3] for call in calls if call.startswith("cfnav")]
    assert said[0] == ["rooms", "boxes"]
    assert [words[0] for words in said].count("train") == 2
    assert said[-1][0] == "export"
    assert demo.run("boxes")[:2] == (0, [])


def test_it_goes_on_where_a_command_failed(demo: Demo) -> None:
    demo.broken.touch()
    code, before, _ = demo.run("boxes_mast")
    assert code != 0
    assert before[-1].startswith("cfnav evaluate")
    demo.broken.unlink()
    code, after, _ = demo.run("boxes_mast")
    assert code == 0
    assert after[0] == before[-1]
    assert not any(call.startswith(("cfnav train", "cfnav rooms")) for call in after)


def test_other_settings_are_no_going_on(demo: Demo) -> None:
    assert demo.run("boxes", SEED="0")[0] == 0
    code, calls, said = demo.run("boxes", SEED="1")
    assert (code, calls) == (2, [])
    assert "made with seed 0," in said
    assert "expected seed 1," in said
    assert "Name another OUT" in said


def test_what_learnt_by_other_words_is_no_going_on(demo: Demo) -> None:
    assert demo.run("turtlebot4")[0] == 0
    done = demo.folder / "out/turtlebot4/done/ours"
    done.write_text(done.read_text().replace("by train ours --dropout 0.1 ", "by train ours "))
    code, calls, said = demo.run("turtlebot4")
    assert (code, calls) == (2, [])
    assert "expected seed 0," in said
    assert ", by train ours --dropout 0.1 --stage1-most" in said


def test_a_detector_on_a_mast_has_three_views(demo: Demo) -> None:
    code, calls, _ = demo.run("boxes_mast", TRAINING="kitchen:100-105", VALIDATION="kitchen:230")
    assert code == 0
    made = [call.split() for call in calls if call.startswith("cfnav rooms boxes")]
    seen = {words[4]: words[words.index("mixed") + 1 :] for words in made if "mixed" in words}
    views = ["mast", f"{demo.folder}/out/mast_66.json", f"{demo.folder}/out/mast_78.json"]
    assert list(seen) == views
    assert [CameraSetUp.read(view).fov_deg[0] for view in views] == [90, 66, 78]
    rooms = [[word for word in seen[view] if word != "--rooms"] for view in views]
    assert rooms == [
        ["kitchen:102", "kitchen:105"], ["kitchen:100", "kitchen:103"],
        ["kitchen:101", "kitchen:104", "kitchen:230"],
    ]  # fmt: skip
    trained = next(call for call in calls if call.startswith("cfnav train"))
    assert "--train-rooms kitchen:100-105 --validation-rooms kitchen:230" in trained


def test_a_view_without_rooms_makes_none(demo: Demo) -> None:
    few = {"TRAINING": "kitchen:102", "VALIDATION": "kitchen:231", "TESTS": "kitchen:300"}
    code, calls, _ = demo.run("boxes_mast", **few)
    assert code == 0
    made = [call.split() for call in calls if call.startswith("cfnav rooms boxes")]
    assert [words[words.index("--rooms") + 1 :] for words in made] == [
        ["kitchen:102", "--rooms", "kitchen:231"], ["kitchen:300"],
    ]  # fmt: skip
    assert {words[words.index("--camera") + 1] for words in made} == {"mast"}


def test_perception_of_any_camera_begins_with_the_masts(demo: Demo) -> None:
    code, calls, _ = demo.run("turtlebot4")
    assert code == 0
    learns = [call for call in calls if call.startswith("cfnav perception")]
    first, second = (f"{demo.folder}/out/{name}/perception/perception.onnx" for name in
                     ("default", "turtlebot4"))  # fmt: skip
    assert [f"--out {first}" in learns[0], "--begin" in learns[0]] == [True, False]
    assert f"--out {second}" in learns[1]
    assert f"--begin {first}" in learns[1]
    looks = [call.split("--camera ")[1].split()[0] for call in calls if "--views" in call]
    assert [CameraSetUp.read(look).size for look in looks] == [(448, 448), (448, 252)]
    code, more, _ = demo.run("default turtlebot4")
    assert code == 0
    assert {call.split("--camera ")[1].split()[0] for call in more if "rooms make" in call} == {
        "mast"
    }
    assert not any(call.startswith("cfnav perception") for call in more)
    assert any(call.startswith("cfnav train") and "/default/" in call for call in more)
