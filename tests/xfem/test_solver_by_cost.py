"""The linear solver that a motion takes by itself: quick for size and step, the same answer."""

import numpy as np
import pytest
from cut_bodies import DENSITY, material

from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports


def _body(divisions, at=0.5, normal=(1.0, 0.9, 0.4), kinematics="corotational"):
    """Elements of a centimetre, held at the left, cut across."""
    dim = len(divisions)
    size = 0.01 * np.array(divisions)
    mesh = (rectangle_mesh if dim == 2 else box_mesh)(divisions, (0,) * dim, size)
    point = np.concatenate([[at * size[0]], 0.5 * size[1:]])
    v = cut_mesh(mesh, [Plane(point, normal[:dim])])
    mass = side_wise_mass(v, DENSITY)
    return DynamicBody(
        InternalForce(v, material(dim), kinematics, FAST),
        mass,
        weight=mass.weight([0.5, *[0.0] * (dim - 2), -1.0]),
        supports=Supports.none(v).prescribe(v, mesh.points[:, 0] == 0.0),
    )


def _moved(kind, body, step, steps, **given):
    scheme, state = kind(body, step, **given), body.rest()
    for _ in range(steps):
        scheme.step(state)
    return scheme, state


def _cholesky(body):
    return Cholesky(body.pattern, body.shape[1], body.fixed.all(axis=1))


@pytest.mark.parametrize("kinematics", ["linear", "corotational"])
@pytest.mark.parametrize("kind", [RealTimeEuler, ImplicitEuler, Trapezoidal, GeneralisedAlpha])
def test_a_motion_is_the_same_as_with_a_factorisation(kind, kinematics):
    body = _body((7, 7, 7), kinematics=kinematics)
    assert body.shape[0] > 500
    _, found = _moved(kind, body, 0.005, 6)
    _, wanted = _moved(kind, body, 0.005, 6, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    # 1e-10 of the forces of each step
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-8 * size)


@pytest.mark.parametrize("fraction", [1e-4, 1e-9, 1e-13])
def test_slivers_are_solved_for_as_well(fraction):
    """A plane that nearly touches nodes, at a fraction of an element from them."""
    body = _body((8, 8, 8), at=(4.0 + fraction) / 8.0, normal=(1.0, 0.0, 0.0))
    ratio = body.mass.weights.max() / body.mass.weights.min()
    assert ratio > 0.1 / fraction
    scheme, found = _moved(Trapezoidal, body, 0.005, 10)
    assert scheme._solver.is_iterative
    _, wanted = _moved(Trapezoidal, body, 0.005, 10, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-7 * size)


@pytest.mark.parametrize(
    ("divisions", "step", "iterates"),
    [
        ((12, 12, 12), 0.01, True),  # 32 iterations against 180 that a factorisation is worth
        ((12, 12, 12), 4.0, True),  # as many as in statics: 82
        ((26, 26, 1), 4.0, False),  # 380 against 50: thin bodies bend
        ((60, 60), 0.001, True),  # 5 against 15
        ((60, 60), 0.1, False),  # 250
    ],
)
def test_what_it_takes_depends_on_the_size_the_shape_and_the_step(divisions, step, iterates):
    body = _body(divisions)
    scheme, state = RealTimeEuler(body, step), body.rest()
    for _ in range(3):
        scheme.advance(state)
    assert scheme.solver.is_iterative == iterates
    same, other = RealTimeEuler(body, step, solver=_cholesky(body)), body.rest()
    for _ in range(3):
        same.advance(other)
    size = np.abs(other.displacement).max()
    assert state.displacement == pytest.approx(other.displacement, abs=1e-7 * size)
