"""The page on bodies of one's own: its programs make the files, its cases are read and solved."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from verify.cli import main
from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guide" / "own-body.md"
TEXT = PAGE.read_text(encoding="utf-8")
PROGRAMS = re.findall(r"^```python\n(.*?)^```", TEXT, re.M | re.S)
CASES = re.findall(r"^```toml\n(.*?)^```", TEXT, re.M | re.S)
NAMES = ["lump", "skin"]


def made(folder, number):
    """The file and the case of a part of the page; the path of the case."""
    program = folder / "make.py"
    program.write_text(PROGRAMS[number], encoding="utf-8")
    subprocess.run([sys.executable, str(program)], cwd=folder, check=True, timeout=120)
    path = folder / f"{NAMES[number]}.toml"
    path.write_text(CASES[number], encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "number", [pytest.param(0, marks=pytest.mark.fenicsx), 1], ids=NAMES
)  # fmt: skip
def test_its_bodies_are_checked_and_solved(tmp_path, capsys, number):
    path = made(tmp_path, number)
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr()
    scene = load_scene(path)
    found = XfemSolver().solve(scene, 0, 0)
    moved = np.linalg.norm(found.displacement[-1], axis=1).max()
    assert 1e-5 < moved < 0.02
    assert len(found.cut_facets) > 0
    if number == 0:
        assert "body: 0.06 × 0.04 × 0.03 m" in said.out
        assert "7.2e-05 m³, 0.072 kg" in said.out
        assert "the case does not use: 'tissue'" in said.err


@pytest.mark.heavy
@pytest.mark.fenicsx
@pytest.mark.parametrize("number", [0, 1], ids=NAMES)
def test_its_cases_are_judged_and_pass(tmp_path, capsys, number):
    path, out = made(tmp_path, number), tmp_path / "out"
    run = ["run", str(path), "--no-conform", "--repetitions", "1"]
    assert main([*run, "--out", str(out)]) == 0
    assert re.search(rf"^{NAMES[number]} +PASS", capsys.readouterr().out, re.M)
    assert (out / "report.html").is_file()
