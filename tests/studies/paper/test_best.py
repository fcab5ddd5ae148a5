"""Which run of each model is shipped."""

from pathlib import Path

import pytest

from cfnav_core.command import run_options
from studies.paper.best import Best, best_runs, main
from studies.paper.runs import COLUMNS


def line(run: str, validation: float) -> dict[str, str]:
    """A line of runs.csv for a folder's name SPLIT_MODEL_METHOD_..."""
    split, model, method, *_ = run.split("_")
    return dict.fromkeys(COLUMNS, "") | {
        "run": run, "preset": "small", "split": split, "model": model, "method": method,
        "validation_cf_sr": str(validation),
    }  # fmt: skip


LINES = [
    line("data1_hoz_ours_later_seed0_aa", 0.6),
    line("data1_hoz_ours_later_seed1_ab", 0.7),
    line("data1_hoz_ours_seed0_ac", 0.3),
    line("data1_hoz_ours_seed1_ad", 0.8),
    line("data1_hoz_truth_seed1_ae", 0.9),
    line("data1_hoz_plain_later_seed0_af", 0.2),
    line("data1_hoz_plain_later_seed1_ag", 0.95),
    line("data1_hoz_plain_seed1_ah", 0.5),
    line("data2_tdanet_ours_seed2_ba", 0.7),
    line("data2_tdanet_ours_tenfold_seed2_bb", 0.75),
    line("data2_tdanet_plain_tenfold_seed2_bc", 0.4),
    line("data2_tdanet_plain_seed2_bd", 0.4),
]
EVERY = {of["run"] for of in LINES}
TDANET = (
    "data2_tdanet_ours_tenfold_seed2_bb", "data2_tdanet_plain_tenfold_seed2_bc",
)  # fmt: skip


@pytest.mark.parametrize(
    ("missing", "hoz"),
    [
        ("nothing", ("data1_hoz_ours_later_seed1_ab", "data1_hoz_plain_later_seed1_ag")),
        ("data1_hoz_ours_later_seed1_ab",
         ("data1_hoz_ours_later_seed0_aa", "data1_hoz_plain_later_seed0_af")),
        ("data1_hoz_plain_later_seed1_ag",
         ("data1_hoz_ours_later_seed0_aa", "data1_hoz_plain_later_seed0_af")),
    ],
)  # fmt: skip
def test_the_best_at_hand_of_the_best_configuration(missing: str, hoz: tuple[str, str]):
    """Not the best run of all, which was one of another configuration."""
    for lines in (LINES, LINES[::-1]):
        found = best_runs(lines, EVERY - {missing})
        assert [(best["run"], plain) for best, plain in found] == [hoz, TDANET]


def test_a_configuration_without_weights_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    folders = ["--results", str(tmp_path), "--grid", str(tmp_path / "grid")]
    monkeypatch.setattr("sys.argv", ["best", *folders])
    assert run_options("best", Best, main) == 2
    assert "runs.csv" in capsys.readouterr().err
    (tmp_path / "runs.csv").write_text("run,split\ndata1_hoz_ours_seed0_ac,data1\n")
    assert run_options("best", Best, main) == 2
    assert "runs.csv of another version of cfnav" in capsys.readouterr().err
    other = LINES[5] | {"run": "data1_hoz_ours_seed1_zz", "preset": "full", "method": "ours"}
    lines = [",".join(LINES[0]), *(",".join(of.values()) for of in (*LINES, other))]
    (tmp_path / "runs.csv").write_text("\n".join(lines))
    for run in EVERY - set(TDANET[1:]):
        folder = tmp_path / "grid" / "runs" / run
        folder.mkdir(parents=True)
        (folder / "best.safetensors").touch()
    assert run_options("best", Best, main) == 0
    said = capsys.readouterr()
    assert said.out == "hoz data1 data1_hoz_ours_later_seed1_ab data1_hoz_plain_later_seed1_ag\n"
    assert "found no weights of data2_tdanet_ours_tenfold_seed*" in said.err
