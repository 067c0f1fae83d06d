"""`import verify` costs next to nothing."""

import statistics
import subprocess
import sys
import time

import pytest

REPETITIONS = 5


def seconds(statement, root):
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True, cwd=root)
    return time.perf_counter() - begin


@pytest.mark.timing
def test_import_verify_takes_at_most_0_3_seconds(root):
    # Alternating, so that a disturbance of the machine hits both; the first pair warms the cache.
    pairs = [
        (seconds("import verify", root), seconds("pass", root)) for _ in range(REPETITIONS + 1)
    ]
    assert statistics.median(full - bare for full, bare in pairs[1:]) <= 0.3
