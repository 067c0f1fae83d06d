"""Compiling ahead of the first use, and what is said where there is no compiler."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from verify import first_use
from verify.cli.main import main
from verify.compare.overlap import OverlapSearch
from verify.compile_times import compile_times
from verify.solution import Solution
from verify.xfem.structured_meshes import box_mesh

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


def test_two_processes_share_the_work_and_their_accounts_are_added(monkeypatch, capsys):
    monkeypatch.setattr(first_use, "_SHARES", (["comparison"], ["comparison"]))
    first_use.compile_here(["comparison"])  # from here on all is in the cache
    assert main(["doctor", "--compile", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["kernels"] == 0
    assert list(found["stages"]) == ["comparison"]


def test_overlaps_in_space_need_no_kernel_that_the_comparison_has_not_compiled():
    first_use.compile_here(["comparison"])
    block = box_mesh((2, 2, 2))
    apart, n = block.points + np.array([0.0, 0.0, 1.0]), len(block.points)
    points = np.concatenate([block.points, apart])
    moved = np.zeros((1, 2 * n, 3))
    moved[0, n:, 2] = -0.1
    with compile_times() as times:
        found = OverlapSearch(
            Solution(points, np.concatenate([block.cells, block.cells + n]), moved)
        ).at()
    assert found.depth == pytest.approx(0.1)
    assert times.kernels == 0


def test_every_stage_is_in_exactly_one_share():
    assert sorted(stage for share in first_use._SHARES for stage in share) == sorted(
        first_use.STAGES
    )


def test_a_kernel_that_does_not_compile_is_an_error_of_one_line(monkeypatch, capsys):
    monkeypatch.setattr(first_use, "_SHARES", (["no such stage"],))
    with pytest.raises(first_use.FirstUseError, match="no such stage"):
        first_use.compile_all()
    assert main(["doctor", "--compile"]) == 3
    assert "a kernel does not compile" in capsys.readouterr().err
