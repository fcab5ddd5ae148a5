"""The bench of one decision, run as a user runs it."""

from __future__ import annotations

import json
import subprocess
import sys


def bench(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "studies.bench.policy", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_both_back_ends_are_measured(tmp_path):
    done = bench("--decisions", "5", "--json", str(tmp_path / "figures.json"))
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads((tmp_path / "figures.json").read_text())
    assert "--decisions 5" in found["command"]
    assert [row["backend"] for row in found["rows"]] == ["onnx", "torch"]
    for row in found["rows"]:
        assert 0 < row["p50_ms"] <= row["p99_ms"]
        assert row["perception_p50_ms"] > 0
        assert row["decisions"] == 5
        assert f"{row['p99_ms']:.2f}" in done.stdout
    onnx, torch = found["rows"]
    # torch is loaded for its own row only
    assert torch["peak_rss_mb"] > onnx["peak_rss_mb"] + 50


def test_bad_input_is_one_sentence(tmp_path):
    for arguments, sentence in (
        (("--decisions", "0"), "expected at least 1"),
        (("--bundle", str(tmp_path)), "found no readable bundle"),
    ):
        done = bench(*arguments)
        assert done.returncode == 2
        assert sentence in done.stderr
        assert len(done.stderr.splitlines()) == 1
