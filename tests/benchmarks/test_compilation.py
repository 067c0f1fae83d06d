"""What the first use of every kernel costs, in a process of its own with an empty cache.

The aim is 20 s on a quiet core. `kernel_tour.py` measures; see there.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.heavy, pytest.mark.timing]

TOUR = Path(__file__).with_name("kernel_tour.py")


def measure(cache):
    done = subprocess.run(
        [sys.executable, str(TOUR)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def test_kernels_compile_once_and_are_found_in_the_cache_after_that(tmp_path):
    first, second = measure(tmp_path), measure(tmp_path)
    whole = sum(first["seconds"].values())
    print(f"\n{first['kernels']} compilations, {whole:.1f} s of processor time")
    for module, seconds in sorted(first["seconds"].items(), key=lambda item: -item[1]):
        print(f"{seconds:6.2f}  {module}")
    assert first["kernels"] > 100
    assert second["kernels"] == 0
    # no module is to make more than a quarter of the wait: it would be one to divide or rewrite
    assert max(first["seconds"].values()) < 0.25 * whole
