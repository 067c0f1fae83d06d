"""The guide to the thesis' scenes is run: its commands, and its Python."""

import shlex
from pathlib import Path

import meshio
import numpy as np
import pytest
from doc_pages import blocks, commands

from verify.cli import main
from verify.scene import Skin
from verify.simulator.skin_mesh import skin_mesh

PAGE = "guide/simulator.md"


@pytest.mark.graphics
def test_every_command_of_the_guide_succeeds(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(commands(PAGE)) == 3
    for line in commands(PAGE):
        assert main(shlex.split(line)[1:]) == 0, line


def test_the_recipe_for_real_anatomy_crops_a_surface_that_is_meshed(tmp_path, monkeypatch) -> None:
    """A dome of quadrilaterals in decimetres, its far side included."""
    monkeypatch.chdir(tmp_path)
    places = np.linspace(-1.0, 1.0, 21)
    x, y = np.meshgrid(places, places, indexing="ij")
    front = np.column_stack([x.ravel(), y.ravel(), 1.0 - 0.3 * (x**2 + y**2).ravel()])
    a = (21 * np.arange(20)[:, None] + np.arange(20)).ravel()
    quads = np.column_stack([a, a + 21, a + 22, a + 1])
    points = np.concatenate([front, front * [1.0, 1.0, -1.0]])
    both = np.concatenate([quads, quads[:, ::-1] + len(front)])
    meshio.Mesh(points, [("quad", both)]).write("body.obj")
    (recipe,) = (block for block in blocks(PAGE, "python") if "body.obj" in block)
    exec(recipe, {})
    skin = skin_mesh(Skin(kind="skin", file=Path("skin.stl"), thickness=2e-3), tmp_path)
    surface = skin.points[: len(skin.points) // 2]
    assert np.ptp(surface[:, :2], axis=0) == pytest.approx([0.1, 0.1], abs=0.011)
    assert surface[:, 2].min() > 0.05
