"""The linear solver that a motion takes by itself: quick for size and step, the same answer."""

import numpy as np
import pytest
from cut_bodies import DENSITY, material

from verify.accelerated import FAST, solver_by_cost
from verify.accelerated.cholesky import Cholesky
from verify.accelerated.solver_by_cost import SolverByCost
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.errors import NotConvergedError
from verify.xfem.generalised_alpha import GeneralisedAlpha
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


def test_corrections_by_the_symmetric_stiffness_end_where_those_by_the_whole_one_do():
    """The energy–momentum scheme; the solver that is given makes it take the whole one."""
    from verify.accelerated.nearly_symmetric import NearlySymmetric

    body = _body((3, 3, 3))
    whole = NearlySymmetric(body.pattern, 3)
    _, found = _moved(EnergyMomentum, body, 0.02, 10)
    _, wanted = _moved(EnergyMomentum, body, 0.02, 10, solver=whole)
    size = np.abs(wanted.displacement).max()
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-9 * size)


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


def test_supports_that_move_are_followed_on_both_sides_of_the_turn():
    """What is below the diagonal is not there before."""
    body = _body((26, 26, 1))
    left = body.fixed
    moved = body.held_by(Supports(left, np.where(left, 1e-3, 0.0)))
    found, state = RealTimeEuler(moved, 4.0), body.rest()
    wanted, other = RealTimeEuler(moved, 4.0, solver=_cholesky(body)), body.rest()
    assert found.solver.is_iterative
    for _ in range(3):
        found.advance(state)
        wanted.advance(other)
    assert not found.solver.is_iterative
    size = np.abs(other.displacement).max()
    assert state.displacement == pytest.approx(other.displacement, abs=1e-7 * size)


def test_without_memory_for_a_factor_it_goes_on_with_iterations(monkeypatch):
    def refuse(*_):
        raise MemoryError

    monkeypatch.setattr(solver_by_cost, "Cholesky", refuse)
    body = _body((26, 26, 1))
    scheme, state = RealTimeEuler(body, 4.0), body.rest()
    scheme.advance(state)
    assert scheme.solver.is_iterative
    assert np.isfinite(state.displacement).all()
    monkeypatch.setattr(solver_by_cost, "_MOST", 20)
    solver = SolverByCost(body.pattern, 3, body.fixed.all(axis=1), True, 1e-10)
    solver.factorize(scheme.blocks)
    with pytest.raises(NotConvergedError):
        solver.solve(scheme.load)
