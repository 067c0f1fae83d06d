"""Supports on parts of the boundary that end where a cut comes out, each side as its own."""

import numpy as np
import pytest

from verify.scene import Scene
from verify.solvers import find_solver

FENICSX = [pytest.param(name, marks=pytest.mark.fenicsx) for name in ("reference", "conforming")]
SOLVERS = [*FENICSX, "xfem", "virtual_node", "subdivision"]
MOVES = {"above": [0.1, 0.2, 0.05], "below": [-0.1, -0.3, 0.02]}
CORNER = {"where": "x < 1e-6 and y < 1e-6", "displacement": [0.0, 0.0]}


def parted(normal, point, ends, further=()):
    """Give a body cut along a plane, whose parts are moved apart by their own borders."""
    d = len(normal)
    height = " + ".join(
        f"{n!r}*({x} - {p!r})" for n, x, p in zip(normal, "xyz", point, strict=False)
    )
    return Scene.model_validate({
        "title": "parted",
        "requirement": "none",
        "geometry": {
            "kind": "rectangle" if d == 2 else "box", "lower": [0.0] * d, "upper": [1.0] * d
        },
        "mesh": {"cells": [[5] * d]},
        "material": {"young": 1.0, "poisson": 0.3} | ({"plane": "strain"} if d == 2 else {}),
        "supports": [
            *({"where": f"{height} {sign} 0", "displacement": MOVES[side][:d]}
              for side, sign in (("above", ">"), ("below", "<"))),
            *further,
        ],
        "cuts": [{"kind": "polyline" if d == 2 else "polygon", "points": ends}],
        "reference": {"size": 0.3 if d == 2 else 0.5},
    })  # fmt: skip


def inclined():
    return parted([-1 / 3, 1.0], [0.5, 0.53], [[-0.1, 0.33], [1.1, 0.73]])


def in_space():
    """Conforming meshes of a box follow parts that end parallel to its edges."""
    ring = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
    return parted([0.0, 0.0, 1.0], [0.5, 0.5, 0.47], [[x, y, 0.47] for x, y in ring])


def through_nodes(further=()):
    """The cut comes out at nodes of the mesh, one of them a corner of the body."""
    return parted([-0.6, 1.0], [0.0, 0.0], [[-0.1, -0.06], [1.1, 0.66]], further)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("scene", [inclined, in_space, through_nodes])
def test_parts_that_their_own_borders_move_rigidly_store_nothing(scene, solver):
    """A node of the mouth that is held as the other side stores a hundredth of a joule or more."""
    found = find_solver(solver).solve(scene(), 0, repetitions=0)
    assert found.ledger["strain"][0] == pytest.approx(0.0, abs=1e-20)
    assert len(np.unique(found.displacement[0].round(12), axis=0)) == 2


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_part_that_is_a_point_at_a_mouth_holds_both_sides_there(solver):
    """No boundary of either side lies on the point: it cannot tell them apart."""
    found = find_solver(solver).solve(through_nodes([CORNER]), 0, repetitions=0)
    at = np.linalg.norm(found.points, axis=1) < 1e-9
    assert at.sum() == 2
    assert found.displacement[0][at] == pytest.approx(np.zeros((2, 2)), abs=1e-15)
