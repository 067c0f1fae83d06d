"""Waits over 2 s have a line, through a pipe too."""

import os
import subprocess
import sys
import textwrap
import time

from verify.cli.waiting import said_to_wait

SLOW = """
    import time
    class Slow:
        name = "slow"
        def refuses(self, scene):
            return None
        def levels(self, scene): return 1
        def solve(self, scene, level, repetitions=1):
            time.sleep(9)
            raise ValueError("nothing")
"""


def test_a_long_solve_says_through_a_pipe_what_is_waited_for(tmp_path):
    (tmp_path / "slow.py").write_text(textwrap.dedent(SLOW))
    command = ["run", "statics/f1_patch", "--solver", "slow:Slow", "--out", "out", "--no-report"]
    done = subprocess.run(
        [sys.executable, "-m", "verify", *command, "--quick", "--judge", "slow:Slow"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(tmp_path)])},
    )  # fmt: skip
    waits = [line for line in done.stderr.splitlines() if line.startswith("…")]
    of_solve = [line for line in waits if "statics/f1_patch · slow:Slow · level 0" in line]
    assert len(of_solve) >= 2  # after 2 s and after 6 s
    assert len(of_solve) < 5
    assert "\r" not in done.stderr
    assert "\x1b" not in done.stderr


def test_nothing_is_said_of_what_is_soon_done(capsys):
    with said_to_wait(sys.stderr, "a little thing"):
        time.sleep(0.1)
    assert capsys.readouterr().err == ""
