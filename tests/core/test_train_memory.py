"""What training frees stays with the process."""

from __future__ import annotations

import subprocess
import sys

import pytest

CODE = """
import torch
from cfnav_core.train import keep_freed_memory, own_memory_mb
if {keep}:
    keep_freed_memory()
before = own_memory_mb()
for _ in range(2):
    tensors = [torch.ones(1 << 18) for _ in range(200)]  # 1 MiB each
    del tensors
print(own_memory_mb() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="asks for GNU's malloc")
def test_freed_memory_is_kept():
    grown = {}
    for keep in (False, True):
        command = [sys.executable, "-c", CODE.format(keep=keep)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        grown[keep] = float(done.stdout)
    assert grown[False] < 50
    assert grown[True] > 150
