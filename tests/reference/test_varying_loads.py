"""Formulas do what the exact solution they write out does: pure bending of an inclined bar."""

import numpy as np
import pytest
from reference_scenes import energy_of, needs_fenicsx, polyline, square

from reference.exact import exact_solution
from verify.exchange import problem_of
from verify.scene import BodyForce, load_scene
from verify.solvers.body_of_scene import background_mesh, cuts_of
from verify.solvers.boundary_conditions import loads_of
from verify.xfem.phantom import cut_mesh

POINT, SLOPE, GRADIENT, POISSON = (0.4, 0.55), 0.31, 0.8, 0.3
C, S = np.array([1.0, SLOPE]) / np.hypot(1.0, SLOPE)
MODULUS, ETA = 1 / (1 - POISSON**2), POISSON / (1 - POISSON)
# local coordinates along and across the bar, as text
ALONG = f"((x - {POINT[0]})*{C} + (y - {POINT[1]})*{S})"
ACROSS = f"((y - {POINT[1]})*{C} - (x - {POINT[0]})*{S})"
U_S = f"{GRADIENT / MODULUS}*{ALONG}*{ACROSS}"
U_T = f"{-0.5 * GRADIENT / MODULUS}*({ALONG}**2 + {ETA}*{ACROSS}**2)"
DISPLACEMENT = [f"{C}*{U_S} - {S}*{U_T}", f"{S}*{U_S} + {C}*{U_T}"]
NORMALS = {"left": (-1, 0), "right": (1, 0)}


def bar(written_out):
    """Prescribe the exact field below and above, its tractions on the left and on the right."""
    tractions = {
        side: [f"{(C * n[0] + S * n[1]) * GRADIENT * k}*{ACROSS}" for k in (C, S)]
        for side, n in NORMALS.items()
    }
    return square(
        # along the bar, where no traction acts, and beside its axis
        [polyline("cut", (-0.1, 0.5 - 0.6 * SLOPE), (1.1, 0.5 + 0.6 * SLOPE))],
        material={"young": 1.0, "poisson": POISSON, "plane": "strain"},
        exact={"solution": "bending", "parameters": {
            "point": list(POINT), "slope": SLOPE, "stress_gradient": [GRADIENT, GRADIENT],
            "shift": [0.0, 0.0],
        }},
        supports=[
            {"where": w, "displacement": DISPLACEMENT if written_out else "exact"}
            for w in ("bottom", "top")
        ],
        loads=[
            {"kind": "traction", "where": side, "traction": t if written_out else "exact"}
            for side, t in tractions.items()
        ],
    )  # fmt: skip


def test_the_exchange_gives_the_nodal_forces_of_the_exact_tractions():
    formulas, exact = problem_of(bar(True), 0), problem_of(bar(False), 0)
    np.testing.assert_allclose(formulas.nodal_forces(), exact.nodal_forces(), atol=1e-15)
    np.testing.assert_allclose(formulas.prescribed()[1], exact.prescribed()[1], atol=1e-15)


def test_a_varying_body_force_has_its_integral_on_both_sides_of_a_cut():
    scene = bar(True).model_copy(
        update={"loads": [BodyForce(kind="body_force", force=["x*y", "y**2"])]}
    )
    mesh, size = background_mesh(scene, 0)
    phantom = cut_mesh(mesh, cuts_of(scene, size))
    for total in (
        problem_of(scene, 0).nodal_forces().sum(axis=0),
        loads_of(scene, phantom, None).sum(axis=0),
    ):
        np.testing.assert_allclose(total, [1 / 4, 1 / 3], rtol=1e-13)


@pytest.mark.parametrize("solver", [pytest.param("conforming", marks=needs_fenicsx)])
def test_the_reference_stores_the_energy_of_pure_bending(solver):
    # the field is quadratic: P2 has it to round-off; off by the condition of slender cells
    scene = bar(True)
    known = exact_solution("bending", scene.exact.parameters, scene.material)
    assert energy_of(scene, solver, degree=2) == pytest.approx(
        known.strain_energy(scene), rel=1e-10
    )


@pytest.mark.parametrize("degree", [pytest.param(k, marks=needs_fenicsx) for k in (1, 2)])
def test_a_bump_that_is_narrower_than_two_facets_of_a_solid_acts_in_full(degree):
    from reference.boundary_conditions import load_forces
    from reference.space import conforming_space
    from verify.solvers.conforming_meshes import peer_mesh

    scene = load_scene("rotation/skin_on_fat")
    space = conforming_space(peer_mesh(scene, 0, "imprinted"), degree, None)
    force = load_forces(scene, space, None).reshape(-1, 3)
    # 6000 (1 − ((x − 0.014)/0.0031)²)² over 2 mm of skin, and so on: 16/15 of a half-width in all
    amount = 16 / 15 * 0.0031 * 0.002
    pulls = amount * np.array([[-6000.0, -1500.0, 0.0], [6000.0, -1000.0, 0.0]])
    scale = np.abs(pulls).max()
    np.testing.assert_allclose(force.sum(axis=0), pulls.sum(axis=0), atol=1e-12 * scale)
    at = np.array([[0.014, 0.0, 0.007], [0.026, 0.0, 0.007]])
    turn = np.cross(space.node_points.reshape(-1, 3), force).sum(axis=0)
    np.testing.assert_allclose(turn, np.cross(at, pulls).sum(axis=0), atol=1e-12 * scale)
