"""Every commit that a figure or an expectation names can be looked at."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md", "docs/*.md", "docs/results/*.md", "docs/deployment/*.json", "docs/bags/*.json",
    "studies/deploy/*.py", "cfnav_core/bundles/*/*.md",
)  # fmt: skip
HASH = re.compile(r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7}\b")


def named():
    pages = [page for pattern in PAGES for page in ROOT.glob(pattern)]
    return {found for page in pages for found in HASH.findall(page.read_text())}


def git(*words, **fields):
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, **fields)


def test_every_commit_that_is_named_is_in_the_history():
    shallow = git("rev-parse", "--is-shallow-repository").stdout.strip()
    if shallow != "false":
        pytest.skip("the history is not here: a shallow clone, or no clone at all")
    asked = sorted(named())
    assert len(asked) > 10
    told = git("cat-file", "--batch-check", input="\n".join(asked) + "\n").stdout.splitlines()
    unknown = [line for line in told if line.split()[1:2] != ["commit"]]
    assert unknown == []
