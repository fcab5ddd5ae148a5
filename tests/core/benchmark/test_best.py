"""Which run of each model is shipped."""

import pytest

from cfnav_core.benchmark.best import best_runs, main


def row(run: str, validation: float) -> dict[str, str]:
    """A line of runs.csv for a folder's name SPLIT_MODEL_METHOD_..."""
    split, model, method, *more = run.split("_")
    if more[0] == "listening":
        method = "listening"
    return {
        "run": run, "split": split, "model": model, "method": method,
        "validation_cf_sr": str(validation),
    }  # fmt: skip


ROWS = [
    row("data1_hoz_ours_later_seed0_aa", 0.6),
    row("data1_hoz_ours_later_seed1_ab", 0.7),
    row("data1_hoz_ours_seed1_ac", 0.7),
    row("data1_hoz_truth_seed1_ad", 0.9),
    row("data1_hoz_plain_later_seed1_ae", 0.95),
    row("data1_hoz_plain_seed1_af", 0.5),
    row("data2_tdanet_ours_listening_tenfold_seed2_ba", 0.8),
    row("data2_tdanet_ours_tenfold_seed2_bb", 0.75),
    row("data2_tdanet_plain_tenfold_seed2_bc", 0.4),
    row("data2_tdanet_plain_seed2_bd", 0.4),
]


def test_the_best_of_ours_goes_with_plain_of_its_seed_and_schedule():
    for rows in (ROWS, ROWS[::-1]):
        found = [(best["run"], plain) for best, plain in best_runs(rows)]
        assert found == [
            ("data1_hoz_ours_later_seed1_ab", "data1_hoz_plain_later_seed1_ae"),
            ("data2_tdanet_ours_listening_tenfold_seed2_ba", "data2_tdanet_plain_tenfold_seed2_bc"),
        ]


def test_without_its_plain_run_nothing_is_shipped(tmp_path, monkeypatch, capsys):
    with pytest.raises(ValueError, match="found no run data2_tdanet_plain_tenfold_seed2_"):
        best_runs(ROWS[:-2])
    monkeypatch.setattr("sys.argv", ["best", str(tmp_path)])
    assert main() == 2
    assert "runs.csv" in capsys.readouterr().err
    lines = [",".join(ROWS[0]), *(",".join(r.values()) for r in ROWS[:6])]
    (tmp_path / "runs.csv").write_text("\n".join(lines))
    assert main() == 0
    assert capsys.readouterr().out == (
        "hoz data1 data1_hoz_ours_later_seed1_ab data1_hoz_plain_later_seed1_ae\n"
    )
