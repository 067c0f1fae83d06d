"""Every command works on one thread, as its records say."""

import os
import subprocess
import sys

from verify.threads import ONE_THREAD

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
