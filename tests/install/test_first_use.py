"""Compiling ahead of the first use, and what is said where there is no compiler."""

import subprocess
import sys
from pathlib import Path

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
