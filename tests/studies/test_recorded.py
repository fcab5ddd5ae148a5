"""The archives in ``docs/results`` give its pages, to the byte, without rooms and weights."""

from __future__ import annotations

import json
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from studies.live import table_iv
from studies.live.table_iv import TableIV
from studies.paper import p_hat_study, shift_study
from studies.paper.command import Benchmark
from studies.paper.run import run_benchmark

RESULTS = Path("docs/results")
NOT_REMADE = {
    "README.md": "written by hand",
    "paths.png": "its episodes are driven again, which needs the weights",
}
DRAWN_BY = RESULTS / "curves_II.png"
"""It names the version of matplotlib that drew the pictures."""

MERGED = ("summary.json", "predictor.json")
"""Hold what several commands made, in the order in which it was made first."""

TENSOR = (
    (("I", "II", "III", "own"), (), 5, "I data1"),
    (("tenfold",), ("tdanet",), 5, "tenfold data2"),
    (("tenfold",), ("lstde",), 1, "tenfold data1"),
)
"""Tables, model and seeds of a command, and a table and data that it made."""

LIVE = ("paper", "all --trials 20", "paper --schedule tenfold",
        "main --trials 100 --seeds 5 --schedule tenfold",
        "sources --trials 20 --first-seed 4 --schedule tenfold")  # fmt: skip


def blotted(found: Any) -> Any:
    """The same with other numbers: what is not made again is not as recorded."""
    if isinstance(found, dict):
        return {name: blotted(value) for name, value in found.items()}
    if isinstance(found, list):
        return [blotted(value) for value in found]
    return 9.99 if isinstance(found, float) else found


def commands(file: str) -> dict[str, list[str]]:
    """Of a JSON file of rows: which command made each table and number of trials."""
    made: dict[str, list[str]] = {}
    for row in json.loads((RESULTS / file).read_text())["rows"]:
        key = row["split"] if row.get("table") == "IV" else f"{row.get('table')} {row['split']}"
        if row["command"] not in made.setdefault(key, []):
            made[key].append(row["command"])
    return made


@pytest.fixture(scope="module")
def again(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results folder, made anew of the archives."""
    folder = tmp_path_factory.mktemp("recorded")
    for archive in sorted(RESULTS.glob("seed*.tar.gz")):
        shutil.unpack_archive(archive, folder)
    grid, nowhere, out = folder / "grid", folder / "none", folder / "results"
    out.mkdir()
    for name in MERGED:
        (out / name).write_text(json.dumps(blotted(json.loads((RESULTS / name).read_text()))))
    made = commands("summary.json")
    records = Benchmark(scenes=nowhere, out=grid, results=out, recorded=True, episodes=nowhere)
    for tables, model, seeds, key in TENSOR:
        of = replace(records, tables=tables, model=model, seeds=seeds)
        run_benchmark(of, *made[key])
    for model, first_seed, seeds in (("tdanet", 3, 2), ("lstde", 4, 1)):
        name = f"p_hat_{model}_from_seed{first_seed}.json"
        p_hat_study.run(
            p_hat_study.PHatStudy(nowhere, grid, out, seeds, first_seed, True, model=(model,)),
            json.loads((RESULTS / name).read_text())["command"],
        )
    shift_study.run(
        shift_study.ShiftStudy(nowhere, grid, out, 2, 3, True),
        *commands("visual_shift.json")["tenfold data2"],
    )
    for rows in LIVE:
        name, *options = shlex.split(rows)
        numbers = dict(zip(options[::2], options[1::2], strict=True))
        config = TableIV(
            nowhere, numbers.get("--schedule", "usual"), int(numbers.get("--trials", 15)),
            int(numbers.get("--seeds", 1)), int(numbers.get("--first-seed", 0)), name,
            recorded=True, out=folder / "trials", results=out,
        )  # fmt: skip
        table_iv.run(
            config, *made[f"{config.trials} live trials{config.words(', ', 'from seed ')}"]
        )
    return out


@pytest.mark.parametrize(
    "name",
    sorted(p.name for p in RESULTS.iterdir() if p.suffix in (".md", ".json", ".csv", ".png")),
)
def test_pages_are_made_again_to_the_byte(again: Path, name: str) -> None:
    if name in NOT_REMADE:
        assert not (again / name).exists(), f"{name} is made again, though {NOT_REMADE[name]}"
        return
    made, recorded = ((of / name).read_bytes() for of in (again, RESULTS))
    if name.endswith(".png") and mpl.__version__.encode() not in DRAWN_BY.read_bytes():
        assert made[:4] == recorded[:4]  # another version of matplotlib draws other pixels
        return
    assert made == recorded
