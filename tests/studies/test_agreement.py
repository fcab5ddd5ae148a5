"""The measurement of agreement goes on from its rows and sums them up."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cfnav_core.policy.bundle import shipped_bundle
from studies.bags.agreement import AgreementConfig, measure
from studies.live.identities import identity_of


def _row(number: int, touched: bool, seen: int | None) -> dict[str, object]:
    return {
        "seed": 0,
        "networks": identity_of(shipped_bundle()),
        "number": number,
        "commit": "abc",
        "live": {"collisions": int(touched), "success": True},
        "bag": {"collisions": int(touched)},
        "equal": True,
        "observed_collisions": seen,
        "observed_success": None,
        "decisions": 10,
        "reproduced": 8,
        "compared": 9,
    }


def test_finished_bags_are_not_driven_again(tmp_path: Path) -> None:
    rows = [_row(0, True, 1), _row(0, False, 1), _row(1, True, 0), _row(1, False, None)]
    file = tmp_path / "drives.jsonl"
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))

    found = measure(AgreementConfig(out=file, bags=2))

    assert found["agreement"] == {"episodes": 4, "equal": 4}
    assert found["observable"]["success"]["untold"] == 4
    counts = {k: found["observable"][k] for k in ("tp", "fp", "fn", "tn", "untold")}
    assert counts == {"tp": 1, "fp": 1, "fn": 1, "tn": 0, "untold": 1}
    own = {"decisions": 40, "reproduced": 32, "not_compared": 4}
    assert found["own_decisions_reproduced"] == own
    assert len(file.read_text().splitlines()) == len(rows)


@pytest.mark.parametrize("other", [{"seed": 1}, {"networks": "another"}])
def test_drives_of_another_seed_or_bundle_are_not_gone_on_with(
    tmp_path: Path, other: dict[str, object]
) -> None:
    file = tmp_path / "drives.jsonl"
    file.write_text(json.dumps(_row(0, True, 1) | other) + "\n")
    with pytest.raises(OSError, match=r"drives.jsonl holds drives of .*; choose another --out"):
        measure(AgreementConfig(out=file, bags=1))
