"""Memory of arrays that are gone is there for the next ones, without the system's help."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource, threading
import numpy as np
from crowd import kept_memory

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def arrays():
    for _ in range(3):
        # 2 MB each, below what NumPy asks large pages for one by one
        made = [np.ones(1 << 18, np.float64) for _ in range(16)]
        counts.append(faults())

counts = []
print(int({keep} and kept_memory.keep()))
thread = threading.Thread(target=arrays)  # as the devices' threads do
thread.start()
thread.join()
print(counts[2] - counts[1])
"""


def _run(keep: bool) -> tuple[bool, int]:
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(keep=keep)], capture_output=True, text=True, check=True)
    kept, faults = done.stdout.split()
    return bool(int(kept)), int(faults)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries take no such advice")
def test_arrays_of_the_next_round_need_no_new_pages() -> None:
    kept, faults = _run(True)
    assert kept
    assert faults < 100 < _run(False)[1]
