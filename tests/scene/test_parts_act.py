"""Supports and loads that would act nowhere are found when the case is read."""

import meshio
import numpy as np
import pytest

from verify.cli import main
from verify.errors import InputError
from verify.scene import load_scene

CASE = """
title = "A body"
requirement = "It shall be held."
[geometry]
{geometry}
[mesh]
{mesh}
[material]
young = 1e4
poisson = 0.3
{plane}
[[supports]]
where = "{held}"
displacement = {zero}
[[loads]]
kind = "traction"
where = "{loaded}"
traction = {force}
"""
RECTANGLE = 'kind = "rectangle"\nlower = [0.0, 0.0]\nupper = [1.0, 1.0]'
BOX = 'kind = "box"\nlower = [0.0, 0.0, 0.0]\nupper = [1.0, 1.0, 1.0]'


def load(folder, geometry=RECTANGLE, mesh="cells = [[4, 4], [8, 8]]", held="left", loaded="right"):
    space = geometry == BOX
    (folder / "case.toml").write_text(
        CASE.format(
            geometry=geometry,
            mesh=mesh,
            plane="" if space else 'plane = "strain"',
            held=held,
            loaded=loaded,
            zero=[0.0] * (2 + space),
            force=[1.0] * (2 + space),
        )
    )
    return load_scene(folder / "case.toml")


@pytest.mark.parametrize("held", ["x < 0", "x > 0.24 and x < 0.26 and y < 0.01", "x > 1"])
def test_an_inequality_that_holds_a_node_within_round_off_is_accepted(tmp_path, held):
    load(tmp_path, held=held)


@pytest.mark.parametrize(
    "held, loaded, said",
    [
        ("x > 5", "right", "supports[0].where"),
        ("hypot(x - 0.5, y - 0.5) < 0.4", "right", "supports[0].where: no node"),
        ("x > 0.3 and x < 0.45 and y < 0.01", "right", "on mesh level 0"),  # 3/8 is a node
        ("left", "x > 0.999 and y > 0.999", "loads[0].where"),
        ("left", "y > 0.9 and x > 0.6 and x < 0.9", "loads[0].where: no facet"),
    ],
)
def test_an_inequality_that_holds_no_node_or_facet_is_named(tmp_path, held, loaded, said):
    with pytest.raises(InputError) as caught:
        load(tmp_path, held=held, loaded=loaded)
    assert said in str(caught.value)


def test_the_faces_of_a_box_are_held_against_the_inequality_too(tmp_path):
    mesh = "cells = [[2, 3, 4]]"
    load(tmp_path, BOX, mesh, "z < 1e-9", "z > 0.999 and x < 0.51")
    for held, loaded in (("z < -1e-3", "top"), ("bottom", "z > 0.999 and x < 0.4")):
        with pytest.raises(InputError, match="boundary"):
            load(tmp_path, BOX, mesh, held, loaded)
    with pytest.raises(InputError, match=r"supports\[0\]\.where: no node"):
        load(tmp_path, BOX, mesh, "hypot(x - 0.5, y - 0.5) < 0.4 and abs(z - 0.5) < 0.4", "top")


def test_a_mesh_file_is_looked_at_by_verify_check(tmp_path, capsys):
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    mesh = meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))])
    mesh.write(tmp_path / "body.vtu")
    given = 'kind = "file"\nfile = "body.vtu"', 'pattern = "given"'
    load(tmp_path, *given, "x < 0.5", "x > 0.5")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    load(tmp_path, *given, "x > 0.2 and x < 0.8", "x > 0.5")
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    assert "supports[0].where" in capsys.readouterr().err
