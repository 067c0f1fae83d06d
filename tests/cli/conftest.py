"""The command line in a process of its own, and in this one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture
def verify(tmp_path):
    """Run ``verify`` in an empty folder; gives return code, out, err."""

    def run(*arguments, timeout=120):
        return subprocess.run(
            [sys.executable, "-m", "verify", *map(str, arguments)],
            cwd=tmp_path,
            env={
                **os.environ,
                "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
            },
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    return run
