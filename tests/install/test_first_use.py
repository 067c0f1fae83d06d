"""Compiling ahead of the first use, and what is said where there is no compiler."""

import subprocess
import sys
from pathlib import Path

import pytest

from verify import first_use
from verify.cli.main import main

ROOT = Path(__file__).resolve().parents[2]


def test_without_numba_a_run_ends_with_one_line_that_names_the_cure(tmp_path):
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from verify.cli.main import main\n"
        f"sys.exit(main(['run', 'statics/f1_patch', '--out', {str(tmp_path / 'out')!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3
    assert done.stderr.splitlines() == [
        "verify: error: this command needs numba, which is not installed: "
        "python -m pip install numba"
    ]


def test_a_kernel_that_does_not_compile_is_an_error_of_one_line(monkeypatch, capsys):
    monkeypatch.setattr(first_use, "_SHARES", (["no such stage"],))
    with pytest.raises(first_use.FirstUseError, match="no such stage"):
        first_use.compile_all()
    assert main(["doctor", "--compile"]) == 3
    assert "compile" in capsys.readouterr().err
