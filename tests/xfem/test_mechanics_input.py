"""Arrays of another body, of another type, or not finite are refused where they are handed over."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, cut_membrane, material
from time_schemes import SCHEMES

from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody, MotionState, MovingSupports
from verify.xfem.elasticity import Material
from verify.xfem.energy_balance import BalanceRecorder, run
from verify.xfem.errors import XfemError
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import ImplicitEuler
from verify.xfem.inherit import inherit_state
from verify.xfem.internal_force import InternalForce, collapsed_cells
from verify.xfem.mass import side_wise_mass
from verify.xfem.supports import Supports


def _body(v, **options):
    force = InternalForce(v, material(v.mesh.dim))
    return DynamicBody(force, side_wise_mass(v, DENSITY), **options)


@pytest.mark.parametrize("v", [cut_body(2), cut_body(3), cut_membrane()], ids=["2D", "3D", "sheet"])
def test_no_array_of_another_shape_or_type_reaches_a_compiled_loop(v):
    """They check no bounds: an array that was too short was written to beyond its end."""
    force = InternalForce(v, material(v.mesh.dim))
    pattern, good = block_pattern(v.cells, v.node_count), np.zeros(v.node_points.shape)
    space = good.shape[1]
    blocks = np.zeros((len(pattern.columns), space, space))
    other = block_pattern(v.mesh.cells[:1] * 0 + np.arange(v.mesh.dim + 1), v.mesh.dim + 1)
    few = np.zeros((len(other.columns), space, space))
    for wrong in (good[:-1], good[:, :1], good.astype("f4"), good.tolist()):
        for call in (
            lambda x: force.evaluate(x),
            lambda x: force.evaluate(good, out=x),
            lambda x: force.add_tangent_product(x, 1.0, good),
            lambda x: force.add_tangent_product(good, 1.0, x),
            lambda x: force.add_stiffness(pattern, blocks, 1.0, "consistent", x),
            lambda x: force.linearise(pattern, x, good, 1.0, 1.0, good, blocks),
            lambda x: force.linearise(pattern, good, x, 1.0, 1.0, good, blocks),
            lambda x: force.linearise(pattern, good, good, 1.0, 1.0, x, blocks),
            lambda x: collapsed_cells(force, x, 1e-3),
        ):
            with pytest.raises(XfemError, match=r"of shape .*; expected \(\d+, \d\), float64"):
                call(wrong)
        with pytest.raises(XfemError, match="of shape"):
            force.linearise(pattern, wrong, good, 1.0, 1.0, good, blocks)
        if force.is_membrane:
            with pytest.raises(XfemError, match="of shape"):
                force.add_geometric(pattern, wrong, blocks, 1.0)
            with pytest.raises(XfemError, match="of shape"):
                force.add_geometric_product(good, wrong, 1.0, good)
    for wrong in (blocks[:-1], blocks.astype("f4"), blocks[:, :, :1]):
        with pytest.raises(XfemError, match="blocks of shape"):
            force.add_stiffness(pattern, wrong)
    with pytest.raises(XfemError, match="expected that of the body"):
        force.add_stiffness(other, few)


def test_moduli_that_store_negative_energy_are_refused():
    v = cut_body(2)
    for lam, mu, message in (
        (1.0, -1.0, "μ > 0"),
        (-2.0, 1.0, "λ > -μ"),
        (np.nan, 1.0, "λ is not finite"),
        (1.0, np.inf, "μ is not finite"),
    ):
        with pytest.raises(XfemError, match=message):
            InternalForce(v, Material(np.array(lam), np.array(mu)))


def test_bodies_refuse_what_is_not_finite_and_what_cannot_be_replaced():
    v = cut_body(2)
    X = v.node_points
    at_rest = np.zeros(X.shape)
    with pytest.raises(XfemError, match="weight"):
        _body(v, weight=at_rest * np.nan)
    with pytest.raises(XfemError, match="function"):
        _body(v, load=at_rest)
    with pytest.raises(XfemError, match="expected RayleighDamping"):
        _body(v, damping=0.1)
    for values in (np.full(X.shape, np.nan), np.zeros(2)):
        with pytest.raises(XfemError, match="supports: values"):
            _body(v, supports=Supports(X == 0.0, values))
    body = _body(v)
    held = Supports.none(v).prescribe(v, v.mesh.points[:, 0] == 0.0)
    for name, value in (("supports", held), ("mass", body.mass), ("force", body.force)):
        with pytest.raises(XfemError, match=f"the {name} of a body cannot be replaced"):
            setattr(body, name, value)
    assert body.held_by(held).fixed.any()
    assert not body.fixed.any()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_states_that_cannot_be_written_and_supports_that_are_nowhere_are_refused(scheme):
    """Velocities in integers were rounded at every step; Euler's schemes went on with nan."""
    v = cut_body(2)
    zero = np.zeros(v.node_points.shape)
    body = _body(v)
    for wrong in (
        MotionState(zero.copy(), zero.astype(int)),
        MotionState(zero.copy(), zero.tolist()),
        MotionState(zero.astype("f4"), zero.copy()),
    ):
        with pytest.raises(XfemError, match="float64"):
            scheme(body, 0.003).step(wrong)
    with pytest.raises(XfemError, match="time nan s"):
        scheme(body, 0.003).step(MotionState(zero.copy(), zero.copy(), np.nan))
    for lost in (np.nan, np.inf):
        away = MovingSupports(
            v.node_points == 0.0, lambda t, lost=lost: (zero + (lost if t > 0.0 else 0.0), zero)
        )
        body = _body(v, supports=away)
        state = body.rest()
        with pytest.raises(XfemError, match="displacement"):
            scheme(body, 0.003).step(state)
        assert state.time == 0.0
        assert not state.displacement.any()


def test_accounts_and_inheritance_refuse_what_is_not_a_step_or_a_state():
    v = cut_body(2)
    body = _body(v)
    state, scheme = body.rest(), CentralDifferences(body, 1e-3)
    with pytest.raises(XfemError, match="-1 steps"):
        run(scheme, body, state, -1)
    ledger = BalanceRecorder(body, state)
    forces = scheme.step(state)
    ledger.record(state, forces)
    with pytest.raises(XfemError, match="no time has passed"):
        ledger.record(state, forces)
    with pytest.raises(XfemError, match="displacement of shape"):
        inherit_state(v, v, MotionState(state.displacement[:3], state.velocity[:3]))
    for options in ({"tolerance": 0.0}, {"tolerance": np.nan}, {"iterations": 0}):
        with pytest.raises(XfemError, match="zero"):
            ImplicitEuler(body, 1e-3, **options)
