"""Neo-Hookean laws of cut bodies: tension along cuts, bodies inside out, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import verify.xfem as xfem
from verify.xfem.statics import NotInEquilibriumError

LAWS = ("neo_hookean", "stable_neo_hookean")
E, NU = 1.0e3, 0.4


def material(law, d):
    return replace(xfem.isotropic(E, NU, "plane strain" if d == 2 else "solid"), law=law)


def bar(d):
    """Make a bar of length 2, cut along through the middle of cells."""
    mesh = xfem.rectangle_mesh((5, 3), upper=(2.0, 1.0)) if d == 2 else (
        xfem.box_mesh((4, 2, 2), upper=(2.0, 1.0, 1.0)))  # fmt: skip
    if d == 2:
        cut = xfem.Polyline([[-1.0, 0.37], [3.0, 0.37]])
    else:
        normal = np.array([0.0, 1.0, 0.6])
        cut = xfem.Plane([0.0, 0.45, 0.4], normal)
    return xfem.cut_mesh(mesh, [cut])


def potential(law, F):
    """Energy density of F (d, d), as the issue's sources state it."""
    lam, mu = float(material(law, len(F)).lam), float(material(law, len(F)).mu)
    J = np.linalg.det(F)
    shape = 0.5 * mu * (np.sum(F**2) - len(F))
    if law == "neo_hookean":
        return shape - mu * np.log(J) + 0.5 * lam * np.log(J) ** 2
    return shape - mu * (J - 1.0) + 0.5 * (lam + mu) * (J - 1.0) ** 2


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("d", [2, 3])
def test_uniaxial_tension_to_twice_the_length_is_uniform_on_both_sides_of_a_cut(law, d):
    """The cut lies along the tension and bears nothing; across, P = 0 gives the contraction."""

    def across(thin):
        step = 1e-6
        F = [np.diag([2.0, *(d - 1) * [thin + s]]) for s in (step, -step)]
        return potential(law, F[0]) - potential(law, F[1])

    thin = brentq(across, 0.3, 1.0, xtol=1e-14)
    body = bar(d)
    force = xfem.InternalForce(body, material(law, d))
    x = body.node_points
    stretched = np.diag([2.0, *(d - 1) * [thin]])
    wanted = x @ (stretched - np.eye(d))
    fixed = np.zeros(x.shape, dtype=bool)
    fixed[(x[:, 0] < 1e-9) | (x[:, 0] > 2.0 - 1e-9)] = True
    found = xfem.static_equilibrium(force, fixed, lambda share: share * wanted, load_steps=4)
    # the differences that `thin` comes from are right to 1e-9
    assert np.abs(found.displacement - wanted).max() < 1e-7
    volume = body.volumes.sum()
    assert found.energy == pytest.approx(volume * potential(law, stretched), rel=1e-8)
    assert found.check.stable


def test_the_energy_with_a_logarithm_is_infinite_inside_out_and_the_stable_one_is_not():
    body = xfem.cut_mesh(xfem.rectangle_mesh((1, 1)), [])
    x = body.node_points
    flipped = x * [-1.0, 1.0] - x
    energies = [xfem.InternalForce(body, material(law, 2)).evaluate(flipped)[1] for law in LAWS]
    assert energies[0] == np.inf
    assert energies[1] == pytest.approx(potential(LAWS[1], np.diag([-1.0, 1.0])), rel=1e-13)


def test_what_is_no_solid_at_finite_rotation_has_no_such_law():
    body, law = bar(2), material("neo_hookean", 2)
    with pytest.raises(xfem.XfemError, match="finite rotation"):
        xfem.InternalForce(body, law, "linear")
    with pytest.raises(xfem.XfemError, match="law"):
        xfem.InternalForce(body, replace(law, law="mooney"))


def test_a_body_that_its_supports_turn_inside_out_is_an_error_that_names_a_piece():
    body = bar(2)
    x = body.node_points
    fixed = np.zeros(x.shape, dtype=bool)
    fixed[(x[:, 0] < 1e-9) | (x[:, 0] > 2.0 - 1e-9)] = True
    through = np.where(x[:, :1] > 1.0, [[-3.0, 0.0]], 0.0)  # one end passes through the other
    force = xfem.InternalForce(body, material("neo_hookean", 2))
    with pytest.raises(NotInEquilibriumError, match="inside out, the first around"):
        xfem.static_equilibrium(force, fixed, lambda share: share * through)
