"""What training frees stays with the process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

CODE = """
import torch
from cfnav_core.learn.train import keep_freed_memory, own_memory_mb
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
    # a threshold that is given does not move: without ours, what is freed goes back to the system
    small = os.environ | {"MALLOC_MMAP_THRESHOLD_": str(1 << 17)}
    grown = {}
    for keep in (False, True):
        command = [sys.executable, "-c", CODE.format(keep=keep)]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=small)
        grown[keep] = float(done.stdout)
    assert grown[False] < 50
    assert grown[True] > 150
