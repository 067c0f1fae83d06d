"""Locking: what an element loses more at Poisson's ratio 0.49 than it does at 0.3."""

from reference_scenes import energy_of, needs_fenicsx, polyline, square

pytestmark = needs_fenicsx

CUT = [polyline("a", (-0.1, 0.5), (0.5, 0.5))]
CLAMPED = [{"where": "bottom", "displacement": [0, 0]}]


def plane(poisson):
    return square(
        CUT,
        material={"young": 1.0, "poisson": poisson, "density": 1.0, "plane": "strain"},
        supports=CLAMPED,
        mesh={"cells": [[12, 12]]},
    )


def loss(scene, degree, level):
    """Share of the energy that ungraded elements miss: what tip and clamps cost, and locking."""
    limit = energy_of(scene, "reference", level=level)
    return 1 - energy_of(scene, "conforming", degree=degree) / limit


def test_linear_elements_lock_and_quadratic_ones_do_not():
    stiff, soft = ([loss(plane(nu), p, 1) for p in (1, 2)] for nu in (0.49, 0.3))
    assert stiff[0] > 2 * soft[0] > 0  # 44 % of the energy missing, 19 % at 0.3
    assert 0 < stiff[1] < 1.5 * soft[1]  # 7.1 % and 5.3 %: tip and clamps
