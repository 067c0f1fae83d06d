"""The project's root and a stand-in for a Python that records what it is asked to do."""

import os
import stat
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Answers the probe of find-python and the system check, makes an environment of one file, and
# writes a line per call of pip. Nothing is downloaded.
STAND_IN = r"""#!/bin/bash
case "$*" in
    *Py_GIL_DISABLED*) echo "complete $0" ;;
    *"-m venv"*)
        target="${@: -1}"
        mkdir -p "$target/bin" && cp "$0" "$target/bin/python"
        echo "home = here" >"$target/pyvenv.cfg" ;;
    *"-m pip"*)
        if [[ "$*" = *"--progress-bar off"* ]]; then # what pip says, and leaves
            printf 'Collecting %s==1\n' numpy scipy
            sleep 1.5
            echo "Installing collected packages: numpy, scipy"
            mkdir -p "${0%/bin/python}/lib/python3/site-packages/numpy-1.dist-info"
        fi
        sleep "${STAND_IN_PIP_SECONDS:-0}"
        echo "$*" >>"$STAND_IN_LOG"
        exit "${STAND_IN_PIP_EXIT:-0}" ;;
    *platform.python_version*) echo 3.12.99 ;;
    *system_requirements.py*)
        if [ -e "${STAND_IN_LACKS:-/nonexistent}" ]; then cat "$STAND_IN_LACKS"; exit 1; fi ;;
esac
"""


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture
def checkout(tmp_path):
    """Return a directory with the set-up scripts, and the environment to run them in."""
    place = tmp_path / "a checkout"
    (place / ".ci").mkdir(parents=True)
    scripts = [path for path in (ROOT / ".ci").iterdir() if path.is_file()]
    for source in [*scripts, ROOT / "pyproject.toml", ROOT / "Makefile"]:
        copy = place / source.relative_to(ROOT)
        copy.write_bytes(source.read_bytes())
        copy.chmod(source.stat().st_mode)
    python = tmp_path / "python-of-the-test"
    python.write_text(STAND_IN)
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(tmp_path),
        "VERIFY_PYTHON": str(python),
        "STAND_IN_LOG": str(tmp_path / "pip.log"),
    }
    return place, environment
