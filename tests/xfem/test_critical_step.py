"""Critical explicit step of a body whose cut leaves ever smaller slivers."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, material

from verify.methods.mass_variants import shifted_mass
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody, StepFailedError
from verify.xfem.cuts import Plane
from verify.xfem.explicit import CentralDifferences, critical_step, element_critical_steps
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

MASSES = {
    "side-wise": side_wise_mass,
    "consistent": consistent_mass,
    "enrichment": lambda v, rho: shifted_mass(v, rho, "enrichment"),
    "row sum": lambda v, rho: shifted_mass(v, rho, "row sum"),
    "weighted diagonal": lambda v, rho: shifted_mass(v, rho, "weighted diagonal"),
}


def _stiffness(v):
    pattern = block_pattern(v.cells, v.node_count)
    return pattern.matrix(InternalForce(v, material(v.mesh.dim), "linear").stiffness(pattern))


def _step(v, mass):
    return critical_step(_stiffness(v), MASSES[mass](v, DENSITY))


def _sliver(dim, epsilon):
    up = np.eye(dim)[-1]
    mesh = rectangle_mesh((8, 8)) if dim == 2 else box_mesh((2, 2, 4))
    return cut_mesh(mesh, [Plane(np.full(dim, 0.5) + epsilon / (8 if dim == 2 else 4) * up, up)])


def catalogue_cuts(dim, size):
    """Slivers of the catalogue: parallel, two cuts, crossing, diagonal, askew, corners cut off."""
    n = 8 if dim == 2 else 4
    up, along = np.eye(dim)[-1], np.eye(dim)[0]
    middle, all_ = np.full(dim, 0.5), np.ones(dim)
    shift = size / n
    yield [Plane(middle, up), Plane(middle + shift * up, up)]
    yield [Plane(middle + shift * up, up), Plane(middle + shift * along, along)]
    yield [Plane(middle + shift * up, up - along)]
    yield [Plane(middle + shift * all_, np.arange(1.0, dim + 1.0))]
    yield [Plane((1.0 - shift) * all_, all_)]
    yield [Plane((1.0 - 1.0 / n - shift) * all_, all_)]


@pytest.mark.parametrize("diagonal", ["alternating", "crossed", "box"])
def test_on_regular_meshes_every_sliver_of_the_catalogue_leaves_three_quarters_of_the_step(
    diagonal,
):
    """Of the assembled uncut body's; that of the smallest element always. The least seen: .81.

    The thesis' lumping leaves 1/√2 of the element's, as is proven.
    """
    dim = 3 if diagonal == "box" else 2
    mesh = box_mesh((4, 4, 4)) if dim == 3 else rectangle_mesh((8, 8), diagonal=diagonal)
    uncut = _step(cut_mesh(mesh, []), "side-wise")
    element = element_critical_steps(mesh, material(dim), DENSITY).min()
    for size in (1e-1, 1e-12, 0.0):
        for cuts in catalogue_cuts(dim, size):
            step = _step(cut_mesh(mesh, cuts), "side-wise")
            # a piece is its element times a factor (1e-9: eigenvalues)
            assert step >= (1.0 - 1e-9) * element
            assert step >= 0.75 * uncut
        assert _step(cut_mesh(mesh, [cuts[0]]), "enrichment") >= 0.70 * element


@pytest.mark.parametrize("dim", [2, 3])
def test_the_step_of_the_other_masses_vanishes_with_the_sliver(dim):
    for mass in ("consistent", "row sum", "weighted diagonal"):
        coarse, fine = (_step(_sliver(dim, e), mass) for e in (1e-2, 1e-4))
        assert fine / coarse == pytest.approx(1e-2, rel=0.05)  # in proportion to its size


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_central_differences_are_stable_below_the_critical_step_and_not_above(factor):
    v = cut_body(2)
    mass = side_wise_mass(v, DENSITY)
    body = DynamicBody(InternalForce(v, material(2), "linear"), mass)
    scheme = CentralDifferences(body, factor * critical_step(_stiffness(v), mass))
    state = body.rest()
    state.velocity[:] = 1e-3 * np.random.default_rng(0).normal(size=body.shape)
    largest = 0.0
    try:
        for _ in range(1000):
            scheme.step(state)
            largest = max(largest, np.abs(state.velocity).max())
    except StepFailedError:
        largest = np.inf
    assert (largest < 0.1) == (factor < 1.0)
