"""Loading: no numba, no threads, in a third of a second."""

import os
import statistics
import subprocess
import sys
import time

import pytest

from verify.processes import ONE_THREAD


def test_without_numba_a_run_ends_with_one_line_that_names_the_cure(tmp_path, root):
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from verify.cli import main\n"
        f"sys.exit(main(['run', 'statics/f1_patch', '--out', {str(tmp_path / 'out')!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3
    assert done.stderr.splitlines() == [
        "verify: error: this command needs numba, which is not installed: "
        "python -m pip install numba"
    ]


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


# the pool of BLAS is made when numpy is loaded: its size is what counts, not the variable
STATEMENT = """
import sys
from verify.cli import main
assert "numpy" not in sys.modules
main(["list", "--exact"])
import numpy, numba
from threading import active_count
numpy.random.default_rng(0).random((500, 500)) @ numpy.ones((500, 500))
with open("/proc/self/status") as status:
    threads = next(int(line.split()[1]) for line in status if line.startswith("Threads:"))
print(threads - active_count(), numba.get_num_threads(), file=sys.stderr)
"""


def test_a_command_starts_no_thread_of_blas_or_numba_whatever_the_environment_says(root):
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "2")}
    run = subprocess.run(
        [sys.executable, "-c", STATEMENT],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stderr.split() == ["0", "1"]
