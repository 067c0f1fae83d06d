"""The cases that the guide shows are read, and solved by the compact solver."""

import re
from pathlib import Path

import numpy as np
import pytest

from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "guide" / "write-a-case.md"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.M | re.S)
TITLES = [re.search(r'^title = "(.*)"', text, re.M) for text in BLOCKS]
# a block without a title is a part of a case
CASES = {title[1]: text for title, text in zip(TITLES, BLOCKS, strict=True) if title}


def test_the_guide_shows_a_case_in_the_plane_in_space_and_in_time():
    assert len(CASES) >= 3


@pytest.mark.parametrize("title", CASES)
def test_a_case_of_the_guide_can_be_solved(tmp_path, title):
    (tmp_path / "case.toml").write_text(CASES[title], encoding="utf-8")
    scene = load_scene(tmp_path / "case.toml")
    solution = XfemSolver().solve(scene, 0, 0)
    assert len(solution.cut_facets) > 0
    assert np.abs(solution.displacement[-1]).max() > 0.0
    if scene.analysis.kind == "dynamic":
        assert len(solution.times) == scene.analysis.outputs
