"""Scenes that the tests of the FEniCSx side share."""

from importlib.util import find_spec

import numpy as np
import pytest
import scenes

from verify.solvers import find_solver

# looked up and not imported: the DOLFINx wheel loads only behind `dolfinx_solver`
_MISSING = [name for name in ("gmsh", "dolfinx") if find_spec(name) is None]
needs_fenicsx = [
    pytest.mark.fenicsx,
    pytest.mark.skipif(bool(_MISSING), reason=f"needs {' and '.join(_MISSING)}"),
]


def polyline(name, *points):
    return {"kind": "polyline", "name": name, "points": [list(p) for p in points]}


def arc(name, centre, radius, start=0.0, sweep=360.0):
    return {"kind": "arc", "name": name, "centre": list(centre), "radius": radius, "start": start,
            "sweep": sweep}  # fmt: skip


def square(cuts=(), **changes):
    """Give a unit square, clamped all around, under its weight."""
    content = {
        "mesh": {"cells": [[8, 8]]},
        "material": scenes.soft(density=1.0),
        "loads": [{"kind": "gravity", "acceleration": [0, -1]}],
    }
    return scenes.scene(cuts, **content | changes)


TENSION = {"top": [0, 1], "bottom": [0, -1]}


def plate(width, height, cuts, loads, supports=None, left=0.0, poisson=0.3, **changes):
    """Give a plate under tractions in balance, held at two corners so that nothing reacts."""
    corner = f"x > {width - 1e-12 * width} and y"
    held = [
        {"where": f"{corner} < {1e-12 * height}", "displacement": [0, 0]},
        {
            "where": f"{corner} > {height - 1e-12 * height}",
            "displacement": [0],
            "components": ["x"],
        },
    ]
    return square(
        cuts,
        geometry={"kind": "rectangle", "lower": [left, 0], "upper": [width, height]},
        material={"young": 1.0, "poisson": poisson, "plane": "strain"},
        supports=supports or held,
        loads=[{"kind": "traction", "where": w, "traction": t} for w, t in loads.items()],
        **changes,
    )


def areas(mesh):
    """Areas (m,) of the cells of a conforming mesh."""
    a, b, c = (mesh.points[mesh.cells[:, k]] for k in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def exterior_facets(mesh):
    """Count the facets that belong to one cell only."""
    facets = np.sort(mesh.cells[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    return int((np.unique(facets, axis=0, return_counts=True)[1] == 1).sum())


def energy_of(scene, solver="reference", level=0, **parameters):
    """Strain energy that a solver of the FEniCSx side adds up, J/m."""
    solution = find_solver(solver).solve(scene, level, repetitions=0, **parameters)
    return float(solution.ledger["strain"][0])
