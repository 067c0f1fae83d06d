"""Faults of case files, named in one line; parts of supports that hold nothing."""

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from case_texts import body_text, cut_text, support_text, weight_text
from doc_pages import blocks

from verify.cli import main
from verify.errors import InputError
from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver

WHOLE = (
    "schema = 1\n"
    + body_text("A strip", "It shall hang.", [1.0, 2.0], [[4, 8], [8, 16]], "1e4", density="1000.0")
    + support_text("top", [0, 0])
    + weight_text()
    + cut_text([-0.1, 1.0], [0.5, 1.0])
    + 'expected = "edge"\n'
    + '[[quantities]]\nkind = "displacement"\nname = "tip"\npoint = [0.5, 0.0]\ncomponent = "y"\n'
    + '[[quantities]]\nkind = "opening"\nname = "mouth"\nat = 0.2\n'
    + '[[acceptance]]\ncheck = "error"\nmetric = "tip"\nat_most = 0.1\n'
)

FAULTS = {
    "number too large": ("poisson = 0.3", "poisson = 0.5", "expected a number < 0.5, got 0.5"),
    "number too small": ("density = 1000.0", "density = 5e-324", "a number ≥ 1e-60, got 4.9"),
    "not a number": ("young = 1e4", "young = nan", "material.young: expected a finite number"),
    "half a cell": ("[8, 16]", "[8, 16.5]", "mesh.cells[1][1]: expected a whole number"),
    "unknown kind": ('"polyline"', '"polylin"', "cuts[0].kind: no 'polylin'; did you mean"),
    "a single table": ("[[supports]]", "[supports]", "supports: expected a list of tables ([[…]]"),
    "cut on the boundary": ("[[-0.1, 1.0], [0.5, 1.0]]", "[[0, 0], [0, 2]]", "cuts nothing"),
    "cut folds back": ("[0.5, 1.0]]", "[0.5, 1.0], [0.2, 1.0]]", "folds back onto itself"),
    "code for a region": ('"top"', '"__import__(1) > x"', "is not allowed; expected an inequality"),
    "division by zero": ('"top"', '"1/0 > x"', "supports[0].where: '1 / 0' in '1/0 > x' is no"),
    "overflow": ('"top"', '"y > 1 or x < 10**999"', "'10 ** 999' in 'y > 1 or x < 10**999' is no"),
    "z in the plane": ('"top"', '"z > 1"', "'z' in 'z > 1' is not allowed"),
    "group without a file": ('"top"', '"group:a"', "'group:a' is of a mesh file; the body is a"),
    "energy not asked for": ('"tip"\nat_most', '"strain_energy"\nat_most', "ask for it: [[quant"),
    "no limit": ("at_most = 0.1", "", "acceptance[0].at_most: missing"),
    "point on the cut": ("point = [0.5, 0.0]", "point = [0.2, 1.0]", "lies on cut 'cut', where"),
    "opening outside": ("at = 0.2", "at = 0.1", "(-0.04, 1), which is not in the body"),
    "force at a point": ('"gravity"', '"point_force"', "infinite energy: give the traction on the"),
    "wrong schema": ("schema = 1", "schema = 2", "schema: expected 1, got 2"),
    "not TOML": ("[mesh]", "[mesh", "not valid TOML"),
}  # fmt: skip


def load(folder: Path, text: str):
    path = folder / "strip.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_file_and_key_in_one_line(tmp_path, fault):
    old, new, expected = FAULTS[fault]
    assert WHOLE.count(old) == 1
    with pytest.raises(InputError) as caught:
        load(tmp_path, WHOLE.replace(old, new))
    message = str(caught.value)
    assert expected in message
    assert message.startswith(str(tmp_path / "strip.toml"))
    assert "\n" not in message


@pytest.mark.parametrize("name", ["nowhere.toml", "statics/f1_pach"])
def test_a_case_that_is_not_there_is_named(name):
    with pytest.raises(InputError, match=r"no such file|did you mean 'statics/f1_patch'"):
        load_scene(name)


def test_links_in_a_circle_are_no_case(tmp_path):
    (tmp_path / "a.toml").symlink_to(tmp_path / "b.toml")
    (tmp_path / "b.toml").symlink_to(tmp_path / "a.toml")
    with pytest.raises(InputError, match="cannot be read"):
        load_scene(tmp_path / "a.toml")


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


def load_held(
    folder, geometry=RECTANGLE, mesh="cells = [[4, 4], [8, 8]]", held="left", loaded="right"
):
    d = 2 + (geometry == BOX)
    text = CASE.format(geometry=geometry, mesh=mesh, held=held, loaded=loaded, zero=[0.0] * d,
                       plane='plane = "strain"' * (d == 2), force=[1.0] * d)  # fmt: skip
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


@pytest.mark.parametrize(
    "held, loaded, said",
    [
        ("hypot(x - 0.5, y - 0.5) < 0.4", "right", "supports[0].where: no node"),
        # a point that is no node of the first mesh
        ("hypot(x - 0.375, y) < 1e-7", "right", "no node of the boundary lies in"),
        ("left", "x > 0.999999 and y > 0.999999", "loads[0].where: no facet"),
        ("left", "x > 0.999999 and y > 0.999999", "or on an edge has an infinite energy: give"),
    ],
)
def test_an_inequality_that_holds_no_node_or_facet_is_named(tmp_path, held, loaded, said):
    with pytest.raises(InputError) as caught:
        load_held(tmp_path, held=held, loaded=loaded)
    for fine in ("x < 0", "x > 0.24 and x < 0.26 and y < 0.01", "x > 1"):  # within round-off
        load_held(tmp_path, held=fine)
    assert said in str(caught.value)


def test_the_faces_of_a_box_are_held_against_the_inequality_too(tmp_path):
    mesh = "cells = [[2, 3, 4]]"
    load_held(tmp_path, BOX, mesh, "z < 1e-9", "z > 0.999 and x < 0.51")
    for held, loaded in (("z < -1e-3", "top"), ("bottom", "z > 0.999999 and x < 1e-6")):
        with pytest.raises(InputError, match="boundary"):
            load_held(tmp_path, BOX, mesh, held, loaded)
    with pytest.raises(InputError, match=r"supports\[0\]\.where: no node"):
        load_held(
            tmp_path, BOX, mesh, "hypot(x - 0.5, y - 0.5) < 0.4 and abs(z - 0.5) < 0.4", "top"
        )


def test_a_mesh_file_is_looked_at_by_verify_check(tmp_path, capsys):
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    mesh = meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))])
    mesh.write(tmp_path / "body.vtu")
    given = 'kind = "file"\nfile = "body.vtu"', 'pattern = "given"'
    load_held(tmp_path, *given, "x < 0.5", "x > 0.5")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    load_held(tmp_path, *given, "hypot(x - 0.5, y - 0.5) < 0.3", "x > 0.5")
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    assert "supports[0].where" in capsys.readouterr().err


BLOCKS = blocks("guide/write-a-case.md", "toml")
TITLES = [re.search(r'^title = "(.*)"', text, re.M) for text in BLOCKS]
# a block without a title is a part of a case
CASES = {title[1]: text for title, text in zip(TITLES, BLOCKS, strict=True) if title}


@pytest.mark.parametrize("title", CASES)
def test_a_case_of_the_guide_can_be_solved(tmp_path, title):
    (tmp_path / "case.toml").write_text(CASES[title], encoding="utf-8")
    scene = load_scene(tmp_path / "case.toml")
    solution = XfemSolver().solve(scene, 0, 0)
    assert len(solution.cut_facets) > 0
    assert np.abs(solution.displacement[-1]).max() > 0.0
    if scene.analysis.kind == "dynamic":
        assert len(solution.times) == scene.analysis.outputs
