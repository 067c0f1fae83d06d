"""Motion of nearly incompressible bodies, whose pressure is an unknown of its own."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline
from test_motion import moving, spread

from verify.solvers import conforming, find_solver

pytestmark = needs_fenicsx

SLIT = polyline("slit", [0.5, 0.4], [0.5, 1.1])


def swinging(cuts=(SLIT,), poisson=0.4999, duration=0.2, time_step=0.01, **changes):
    """Give a block on a floor that is pulled down and aside."""
    motion = {"kind": "dynamic", "duration": duration, "time_step": time_step, "outputs": 3}
    content = {
        "analysis": motion,
        "material": {"young": 1e4, "poisson": poisson, "plane": "strain", "density": 1000.0},
        "supports": [{"where": "bottom", "displacement": [0, 0]}],
        "loads": [{"kind": "gravity", "acceleration": [0.98, -0.98]}],
        "reference": {"size": 0.5},
    }
    return moving(list(cuts), **content | changes)


def solved(scene, level=0):
    return find_solver("reference").solve(scene, level, repetitions=0)


def test_a_body_in_equilibrium_stays_where_statics_with_a_pressure_finds_it():
    scene = swinging(initial={"kind": "equilibrium", "cuts": "open"})
    still = scene.model_copy(update={"analysis": type(scene.analysis)()})
    found, static = solved(scene), solved(still)
    assert found.notes["unknowns"] == static.notes["unknowns"] == "displacement and pressure"
    assert found.ledger["strain"] == pytest.approx(static.ledger["strain"][0], rel=1e-8)
    size = np.abs(static.displacement).max()
    for displacement in found.displacement:
        assert displacement == pytest.approx(static.displacement[0], abs=1e-8 * size)
    assert found.ledger["kinetic"].max() < 1e-12 * found.ledger["strain"][0]


def test_the_account_closes_and_a_cut_that_opens_on_the_way_costs_next_to_nothing():
    scene = swinging([SLIT | {"opens_at": 0.1}], poisson=0.49)
    damped = scene.analysis.model_copy(update={"damping": (1.0, 1e-3)})
    ledger = solved(scene.model_copy(update={"analysis": damped})).ledger
    assert spread(ledger["total"] + ledger["kinetic"].max()) < 1e-10
    # pressures that may jump across the cut take up a little more of div u, the scheme takes some
    assert abs(ledger["algorithmic"][-1]) < 0.02 * ledger["strain"].max()
    assert ledger["damping"][-1] > 0


def test_a_pressure_halves_the_error_of_a_coarse_mesh_in_motion(monkeypatch):
    """Held on three sides, so that what sinks has to rise beside: 10 and 27 % of the energy."""
    walls = [{"where": w, "displacement": [0, 0]} for w in ("bottom", "left", "right")]
    scene = swinging(supports=walls, time_step=0.02, duration=0.3)

    def energy(level):
        return solved(scene, level).ledger["strain"][-1]

    fine, mixed = energy(2), energy(0)
    monkeypatch.setattr(conforming, "wants_pressure", lambda *_: False)
    pure = energy(0)
    assert pure < mixed < fine
    assert fine - mixed < 0.5 * (fine - pure)
