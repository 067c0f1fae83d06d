"""Cuts with something small of their own, and what is said where round-off rules."""

import math

import numpy as np
import pytest

from verify.study.slivers.bodies import DENSITY, background, swept_body, uncut_body
from verify.study.slivers.conditioning import HeldStiffness, stiffness_matrix
from verify.study.slivers.explicit_step import estimated_step, linear_course, mass_of
from verify.study.slivers.inversion import swing
from verify.study.slivers.placements import PLACEMENTS, placed_cuts, row_height
from verify.study.slivers.running import _at_large_strain, _explicit
from verify.xfem.critical_step import element_critical_steps
from verify.xfem.dynamics import CentralDifferences, EnergyMomentum
from verify.xfem.elasticity import isotropic
from verify.xfem.errors import XfemError

MESH = {2: background(2), 3: background(3, quick=True)}
SOFT = isotropic(1e4, 0.3, "plane strain")


def body(placement, size, treatment="keep", dimension=2):
    return swept_body(MESH[dimension], placement, size, treatment)


def body_volumes(swept):
    return np.sort(
        np.bincount(swept.virtual.bodies[swept.virtual.cells[:, 0]], swept.virtual.volumes)
    )


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("size", [0.5, 1e-3, 1e-9])
def test_strip_and_corner_have_the_volume_of_their_geometry(dimension, size):
    """ε h for a strip across the unit body, (ε h)^d/d! for a corner; to round-off of volumes."""
    small = size * row_height(dimension)
    strip = body_volumes(body("two cuts apart", size, dimension=dimension))
    assert len(strip) == 3
    # the strip is a difference of two cuts, each placed to round-off of its coordinates
    assert strip[0] == pytest.approx(small, rel=1e-12, abs=1e-15)
    corner = body_volumes(body("corner cut off", size, dimension=dimension))
    assert corner[0] == pytest.approx(small**dimension / math.factorial(dimension), rel=1e-9)
    for volumes in (strip, corner):
        assert volumes.sum() == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_crossing_cuts_make_four_bodies_and_come_as_near_to_a_vertex_as_asked(dimension):
    for size in (0.5, 1e-3, 1e-12, 0.0):
        swept = body("crossing cuts", size, dimension=dimension)
        assert swept.virtual.bodies.max() == 3
        assert swept.virtual.volumes.sum() == pytest.approx(1.0, abs=1e-13)
        distance = np.linalg.norm(MESH[dimension].points - swept.cut.point, axis=1).min()
        assert distance == pytest.approx(size * row_height(dimension), rel=1e-3, abs=1e-16)


def test_the_strip_is_scaled_by_its_thickness_and_nothing_else():
    """Every block of the strip is ε times the same: numpy's own κ after scaling does not move.

    Within 1e-3: the strip's position moves by ε as well.
    """
    found = []
    for size in (1e-3, 1e-5):
        swept = body("two cuts apart", size)
        free = ~swept.held.ravel()
        K = stiffness_matrix(swept).toarray()[np.ix_(free, free)]
        scale = 1.0 / np.sqrt(np.diag(K))
        found.append(np.linalg.cond(scale[:, None] * K * scale))
        own = HeldStiffness(swept).condition_number("side-wise", "Jacobi")
        assert own == pytest.approx(found[-1], rel=1e-8)
    assert found[0] == pytest.approx(found[1], rel=1e-2)


def test_a_thin_strip_is_too_stiff_and_more_so_in_xfem_than_if_meshed():
    """Exponent −1 in XFEM, towards −2 with one layer of triangles, where a beam has −3.

    The beam: a cantilever of length 1 in plane strain, 4/(E' t³).
    """
    sizes = np.array([1e-2, 5e-3])
    kept, meshed = (
        np.array([HeldStiffness(body("two cuts apart", s, t)).compliance for s in sizes])
        for t in ("keep", "conforming")
    )
    beam = 4.0 / (1e4 / (1.0 - 0.3**2) * (sizes * row_height(2)) ** 3)
    assert kept[1] / kept[0] == pytest.approx(2.0, rel=0.02)
    assert 3.0 < meshed[1] / meshed[0] < 4.0
    assert (10.0 * kept < meshed).all()
    assert (10.0 * meshed < beam).all()


def test_what_is_round_off_is_not_given_as_a_number():
    with pytest.raises(XfemError, match="round-off"):
        _ = HeldStiffness(body("two cuts apart", 1e-6, "conforming")).compliance
    thin = body("two cuts apart", 1e-12, dimension=3)
    with pytest.raises(XfemError, match="singular to round-off"):
        estimated_step(thin, mass_of(thin, "consistent"))


@pytest.mark.parametrize("treatment", ["conforming snapped", "snapped"])
@pytest.mark.parametrize("placement", PLACEMENTS[2])
def test_snapping_bounds_the_step_of_whatever_is_left(placement, treatment):
    """A snapped mesh has no feature below its threshold, unless two cuts are that near."""
    swept = body(placement, 1e-3, treatment)
    assert swept.virtual.volumes.sum() == pytest.approx(1.0, abs=1e-13)
    uncut = element_critical_steps(MESH[2], SOFT, DENSITY).min()
    step = estimated_step(swept, mass_of(swept, "side-wise"))
    splits_on = treatment == "conforming snapped"
    if splits_on and placement in ("two cuts apart", "crossing cuts", "corner cut off"):
        assert step < 0.01 * uncut
    else:
        assert step > 0.1 * uncut


def test_the_force_in_a_run_is_that_of_the_penalised_stiffness():
    """Linear: f = K u with the same K whose critical step is estimated, to round-off."""
    swept = body("crossing cuts", 1e-3, "ghost penalty")
    u = np.random.default_rng(2).normal(size=swept.held.shape)
    force, _ = swept.force("linear").evaluate(u)
    K = stiffness_matrix(swept)
    assert force.ravel() == pytest.approx(K @ u.ravel(), rel=1e-10, abs=1e-10 * abs(K).max())


def test_a_free_corner_is_an_element_alone():
    """Stable just below the element's step, unstable at 0.9 of the assembled uncut one."""
    swept = body("corner cut off", 1e-3)
    mass = mass_of(swept, "side-wise")
    element = element_critical_steps(MESH[2], SOFT, DENSITY).min()
    assert estimated_step(swept, mass) == pytest.approx(element, rel=1e-9)
    whole = estimated_step(
        body("corner cut off", 0.0), mass_of(body("corner cut off", 0.0), "side-wise")
    )
    assert 0.9 * whole > element
    assert linear_course(swept, mass, 0.9 * whole, 500).blown_up
    assert not linear_course(swept, mass, 0.95 * element, 500).blown_up


def test_the_ghost_penalty_keeps_upright_what_would_invert():
    ends = []
    for treatment in ("keep", "ghost penalty"):
        swept = body("along faces", 1e-3, treatment)
        mass = mass_of(swept, "side-wise")
        step = 0.9 * estimated_step(swept, mass)
        ends.append(swing(swept, mass, lambda b, h=step: CentralDifferences(b, h), 1000))
    assert ends[0].inverted > 0
    assert ends[1].inverted == 0
    assert not ends[1].blown_up


def test_a_placement_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="expected one of along faces"):
        placed_cuts(MESH[2], "along edges", 0.1)
    with pytest.raises(ValueError, match="expected one of"):
        body("askew", 0.1)


def test_a_mass_that_is_singular_ends_the_measurement_not_the_study():
    thin = body("corner cut off", 1e-6, "ghost penalty", dimension=3)
    found = [*_at_large_strain(thin, quick=False), *_explicit(thin, 0.05, quick=False)]
    assert {m.value for m in found} == {None}
    assert all("singular to round-off" in m.reason for m in found)
    assert {m.quantity for m in found} == {
        "inverted pieces",
        "steps to blow-up, large strain",
        "steps to blow-up, explicit",
    }


def test_conserving_steps_go_on_where_crossing_cuts_leave_slivers():
    """Their stiffness is not symmetric; its rows of slivers, 1e-24 of the others', got lost."""
    mesh = background(2)
    whole = uncut_body(mesh)
    step = 10.0 * estimated_step(whole, mass_of(whole, "side-wise"))
    swept = swept_body(mesh, "crossing cuts", 1e-12, "keep")
    # failed at step 33, with a residual of 1e-6 m/s² among 59
    mass = mass_of(swept, "side-wise")
    end = swing(swept, mass, lambda b: EnergyMomentum(b, step), 40, every=1)
    assert not end.blown_up, end.reason
    assert end.energy == pytest.approx(1.0, abs=1e-12)
