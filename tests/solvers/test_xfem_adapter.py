"""XFEM as a solver: bases, energies, ends, given meshes, parts of supports; guests that load."""

import numpy as np
import pytest
import scenes
from case_texts import body_text, cut_text, support_text, weight_text

from verify.compare.body import body_of
from verify.compare.cut_deviation import realised_cut
from verify.compare.cut_rule import cut_rule_of
from verify.errors import InputError
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.solvers.xfem import XfemSolver

STRIP = (
    body_text(
        "A hanging strip, cut halfway",
        "It shall hang.",
        [0.02, 0.1],
        [[4, 21], [8, 41]],
        young="1e4",
        density="1000.0",
    )
    + support_text("top", [0, 0])
    + weight_text()
    + cut_text([0.0, 0.05], [0.01, 0.05])
)


def scene(folder, *changes, base=STRIP):
    text = base
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "strip.toml").write_text(text)
    return load_scene(folder / "strip.toml")


def test_an_end_inside_an_element_is_reported_with_how_far_it_moved(tmp_path):
    # on an edge, and 2 mm past it, in elements 5 mm wide, along the middle of a row of elements
    on_edge, past = scene(tmp_path), scene(tmp_path, ("[0.01, 0.05]", "[0.012, 0.05]"))
    for one, left in ((on_edge, 0.0), (past, 0.002)):
        body, found = body_of(one), XfemSolver().solve(one, 0, tip="inside")
        cut = realised_cut(found, body, cut_rule_of(body, found.size)).record
        assert cut.missing == pytest.approx(left, abs=5e-5)  # between points
        assert max(cut.surplus, cut.lateral) < 1e-12


def test_timings_have_one_entry_per_repetition_and_the_first_call_is_not_among_them(tmp_path):
    solution = XfemSolver().solve(scene(tmp_path), 0, repetitions=4)
    phases = {"enrichment", "loading", "analysis", "assembly", "factorisation", "solve"}
    assert set(solution.timings) == phases | {"meshing"}
    assert {len(solution.timings[phase]) for phase in phases} == {4}


def test_a_ghost_penalty_is_reported_with_its_share_of_the_energy(tmp_path):
    """It stiffens: the strain energy under dead loads is less, by about its share."""
    plain = XfemSolver().solve(scene(tmp_path), 1, 0)
    found = XfemSolver().solve(scene(tmp_path), 1, 0, slivers="penalise")
    (entry,) = [r for r in found.regularisations if "ghost penalty" in r.kind]
    assert entry.unit == "of the strain energy"
    assert entry.count > 0
    assert 0.0 < entry.size < 0.2
    assert 0.8 < found.ledger["strain"][0] / plain.ledger["strain"][0] < 1.0


def test_a_part_may_end_at_a_cut_inside_an_element(tmp_path):
    """Below the cut the left side is held, above it the right one: each half hangs by its own."""
    parts = '"y < 0.0512 and x < 1e-9"\ndisplacement = [0.0, 0.0]\n[[supports]]\nwhere = '
    parts += '"y > 0.0512 and x > 0.01999"\ndisplacement = [1e-4, 0.0]'
    weightless = ("acceleration = [0.0, -9.8]", "acceleration = [0.0, 0.0]")
    through = ("[[0.0, 0.05], [0.01, 0.05]]", "[[-0.1, 0.0512], [0.1, 0.0512]]")
    strip = scene(tmp_path, ('"top"\ndisplacement = [0.0, 0.0]', parts), weightless, through)
    found = XfemSolver().solve(strip, 0, 0)
    above = found.points[found.cells].mean(axis=1)[:, 1] > 0.0512
    moved = found.displacement[0][found.cells]
    wanted = np.where(above[:, None, None], [1e-4, 0.0], [0.0, 0.0])
    np.testing.assert_allclose(moved, np.broadcast_to(wanted, moved.shape), atol=1e-15)


MOVES = {"above": [0.1, 0.2, 0.05], "below": [-0.1, -0.3, 0.02]}
CORNER = {"where": "x < 1e-6 and y < 1e-6", "displacement": [0.0, 0.0]}


def parted(normal, point, ends, further=()):
    """Give a body cut along a plane, whose parts are moved apart by their own borders."""
    d = len(normal)
    height = " + ".join(
        f"{n!r}*({x} - {p!r})" for n, x, p in zip(normal, "xyz", point, strict=False)
    )
    moved = [
        {"where": f"{height} {sign} 0", "displacement": MOVES[side][:d]}
        for side, sign in (("above", ">"), ("below", "<"))
    ]
    return scenes.scene(
        [{"kind": "polyline" if d == 2 else "polygon", "points": ends}],
        d,
        mesh={"cells": [[5] * d]},
        supports=[*moved, *further],
        reference={"size": 0.3 if d == 2 else 0.5},
    )


def inclined():
    return parted([-1 / 3, 1.0], [0.5, 0.53], [[-0.1, 0.33], [1.1, 0.73]])


def in_space():
    """Conforming meshes of a box follow parts that end parallel to its edges."""
    ring = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
    return parted([0.0, 0.0, 1.0], [0.5, 0.5, 0.47], [[x, y, 0.47] for x, y in ring])


def through_nodes(further=()):
    """The cut comes out at nodes of the mesh, one of them a corner of the body."""
    return parted([-0.6, 1.0], [0.0, 0.0], [[-0.1, -0.06], [1.1, 0.66]], further)


FENICSX = (("conforming", in_space), ("conforming", through_nodes), ("reference", inclined))


@pytest.mark.parametrize(
    "solver, scene",
    [*(pytest.param(*one, marks=pytest.mark.fenicsx) for one in FENICSX), ("xfem", inclined),
     ("xfem", in_space), ("xfem", through_nodes), ("virtual_node", through_nodes),
     ("subdivision", in_space)],
)  # fmt: skip
def test_parts_that_their_own_borders_move_rigidly_store_nothing(scene, solver):
    """A node of the mouth that is held as the other side stores a hundredth of a joule or more."""
    found = find_solver(solver).solve(scene(), 0, repetitions=0)
    assert found.ledger["strain"][0] == pytest.approx(0.0, abs=1e-20)
    assert len(np.unique(found.displacement[0].round(12), axis=0)) == 2


@pytest.mark.parametrize(
    "solver", ["xfem", "virtual_node", pytest.param("conforming", marks=pytest.mark.fenicsx)]
)
def test_a_part_that_is_a_point_at_a_mouth_holds_both_sides_there(solver):
    """No boundary of either side lies on the point: it cannot tell them apart."""
    found = find_solver(solver).solve(through_nodes([CORNER]), 0, repetitions=0)
    at = np.linalg.norm(found.points, axis=1) < 1e-9
    assert at.sum() == 2
    assert found.displacement[0][at] == pytest.approx(np.zeros((2, 2)), abs=1e-15)


_MIDDLE = np.array([0.53, 0.47])


def _three_cuts(gap, kinematics="linear"):
    """A square with three inclined cuts, each `gap` off a common point; all sides are held."""
    cuts = []
    for k, angle in enumerate((0.3, 1.4, 2.5)):
        normal = np.array([np.cos(angle), np.sin(angle)])
        along = np.array([-normal[1], normal[0]])
        ends = _MIDDLE + gap * normal + np.array([[-2.0], [2.0]]) * along
        cuts.append({"kind": "polyline", "name": f"cut {k}", "points": ends.tolist()})
    return scenes.scene(
        cuts,
        mesh={"cells": [[5, 4]]},
        analysis={"kinematics": kinematics},
        loads=[{"kind": "body_force", "force": [0.0, -0.01]}],
    )


def _speck(solution):
    kind = "loose part of round-off size joined to its neighbour"
    return [entry for entry in solution.regularisations if entry.kind == kind]


@pytest.mark.parametrize("kinematics", ["linear", "finite_rotation"])
def test_a_part_of_round_off_size_moves_with_its_neighbour_and_is_counted(kinematics):
    solver = find_solver("xfem")
    met = solver.solve(_three_cuts(0.0, kinematics), 0)
    assert not _speck(met)
    for share in (1e-13, 1e-7, 1e-4):
        missed = solver.solve(_three_cuts(0.2 * share, kinematics), 0)
        (entry,) = missed.regularisations  # joined, or within round-off of its cell left out
        # a triangle whose sides are some gaps long, of elements with legs of 0.2 and 0.25
        assert entry.count == 1
        assert 0.0 < entry.size < max(10 * share**2, 2 * np.finfo(float).eps)
        # the cuts moved by the gap, and what is between them moves as its neighbour does
        assert np.abs(missed.displacement).max() == pytest.approx(
            np.abs(met.displacement).max(), rel=1e-2 * max(share / 1e-4, 1e-6)
        )


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    "solver, shares", [("conforming", (1e-13, 1e-10, 1e-7, 1e-4)), ("reference", (1e-10, 1e-4))]
)
def test_conforming_meshes_join_and_count_it_too(solver, shares):
    asked = find_solver(solver)
    met = asked.solve(_three_cuts(0.0), 0, repetitions=0)
    assert not _speck(met)
    joined = 0
    for share in shares:
        missed = asked.solve(_three_cuts(0.2 * share), 0, repetitions=0)
        joined += sum(entry.count for entry in _speck(missed))
        # cuts that moved by a ten-thousandth of an element change the energy by about as much
        assert missed.ledger["strain"][0] == pytest.approx(met.ledger["strain"][0], rel=1e-4)
    # gmsh and the imprint take what is closer than 1e-9 of the body for one point
    assert joined >= 1
    assert _speck(missed)


GUESTS = {
    "syntax": ("import os\nclass A\n", ["SyntaxError", "syntax.py:2"]),
    "raises": (
        "class A:\n    def __init__(self):\n        {}['young']\n",
        ["young", "raises.py:3"],
    ),
    "imports": ("\nfrom verify.scene import Nothing\n", ["Nothing", "imports.py:2"]),
    "needs": ("import numpy\nimport no_such_thing\n", ["'no_such_thing'", "needs.py:2"]),
    "leaves": ("raise SystemExit('not today')\n", ["not today", "leaves.py:1"]),
    "asks": ("class A:\n    def __init__(self, more): ...\n", ["'more'", "without arguments"]),
    "lacks": ("class A:\n    def refuses(self, scene): ...\n", ["has no levels()", "solve"]),
    "gives": ("def A(): ...\n", ["has no refuses()"]),
}


@pytest.mark.parametrize("name", GUESTS)
def test_a_guest_that_cannot_be_loaded_is_said_with_file_and_line(name, tmp_path, monkeypatch):
    text, tokens = GUESTS[name]
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError) as said:
        find_solver(f"{name}:A")
    for token in (f"'{name}:A'", *tokens):
        assert token in str(said.value)


@pytest.mark.parametrize(
    "name, token",
    [
        ("no_such_module:A", "no module 'no_such_module'"),
        (":A", "MODULE:CLASS"),
        ("json:", "MODULE:CLASS"),
        ("json:Solver", "no 'Solver'"),
    ],
)
def test_a_name_of_no_class_says_what_was_expected(name, token):
    with pytest.raises(InputError, match=token):
        find_solver(name)
