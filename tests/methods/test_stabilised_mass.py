"""Stabilised masses of others: mass of each part, modes of the uncut cell, explicit steps."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, cut_membrane
from scipy.linalg import eigh
from test_junctions import fork

from verify.methods.mass_variants import (
    eigenvalue_stabilised_mass,
    generalised_eigenvalue_stabilised_mass,
)
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.system import critical_step, lowest_frequency
from verify.xfem.cuts import ImplicitCut, Polyline
from verify.xfem.mass import consistent_mass, second_moments
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

BODIES = [lambda: cut_body(2), lambda: cut_body(3), cut_membrane]
XFEM = find_solver("xfem")


@pytest.mark.parametrize("body", BODIES)
def test_a_stabilisation_keeps_the_mass_of_every_part_or_adds_thousandths_and_lowers_nothing(body):
    """By eigenvalues: at most d modes of a part, each with ε_S m (1·φ)² ≤ 1e-3 (d + 1) of it."""
    v = body()
    plain, generalised, more = (
        mass(v, DENSITY).matrix
        for mass in (
            consistent_mass, generalised_eigenvalue_stabilised_mass, eigenvalue_stabilised_mass
        )
    )  # fmt: skip
    sums = plain.sum(axis=0)
    np.testing.assert_allclose(generalised.sum(axis=0), sums, atol=1e-12 * abs(sums).max())
    least = np.linalg.eigvalsh((generalised - plain).toarray())[0]
    assert least > -1e-12 * abs(plain).max()
    added, corners = (more - plain).sum(), v.cells.shape[1]
    assert 0.0 <= added <= 1e-3 * corners * (corners - 1) * DENSITY * v.volumes[v.split].sum()


def uncut_bound(scene):
    """2/ω of K = c ∫|∇u|² against the mass of an uncut cell, where σ:ε ≤ c |∇u|² for any u."""
    young, poisson = scene.material.young, scene.material.poisson
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear, side = young / (2 * (1 + poisson)), 1 / scene.mesh.cells[0][0]
    energy = 0.5 * np.array([[2.0, -1.0, -1.0], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    mass = scene.material.density * side**2 / 24 * (np.ones((3, 3)) + np.eye(3))
    largest = eigh(energy, mass, eigvals_only=True)[-1]
    return 2.0 / np.sqrt((2 * shear + 2 * lame) * largest)


@pytest.mark.parametrize(
    ("case", "epsilon"), [("slivers/plane_edges", "1e-12"), ("benchmark/c8_slivers", "0.0001")]
)
def test_no_sliver_makes_the_step_with_a_generalised_stabilisation_less_than_a_cell_may(
    case, epsilon
):
    scene = load_scene(f"{case}[epsilon={epsilon}]")
    bound = uncut_bound(scene)
    step = {m: critical_step(XFEM.system(scene, 0, mass=m)) for m in ("gevs", "consistent")}
    assert step["gevs"] >= bound
    assert step["consistent"] < bound


def test_a_stabilised_mass_moves_the_lowest_frequency_less_than_lumping():
    """On the coarse mesh of the family, whatever the sliver."""
    for epsilon in ("0.1", "1e-06"):
        scene = load_scene(f"slivers/plane_edges[epsilon={epsilon}]")
        evs, gevs, plain, lumped = (
            lowest_frequency(XFEM.system(scene, 0, mass=name))
            for name in ("evs", "gevs", "consistent", "sidewise")
        )
        assert max(abs(evs - plain), abs(gevs - plain)) < abs(lumped - plain)


@pytest.mark.parametrize("distance", [1e-8, 1e-10])
def test_no_round_off_of_a_sliver_becomes_mass_with_a_generalised_stabilisation(distance):
    """Modes but the constant move no mass; unmended the nodal sums were 1e-2 and 170 times off.

    The moments of a sliver are known to 1e-16 over its thickness, relative: 1e-6 at most.
    """
    normal = np.array([0.3 * distance, 1.0, 0.2 * distance])
    cut = ImplicitCut(lambda points: (points - 1.0 / 3.0) @ normal - distance)
    v = cut_mesh(box_mesh((3, 3, 3)), [cut])
    more = generalised_eigenvalue_stabilised_mass(v, DENSITY).weights
    np.testing.assert_allclose(more, consistent_mass(v, DENSITY).weights, rtol=1e-6)


def mass_by_parts(phantom, raised):
    """Consistent mass in which `raised` acts on the moments of each part, one after the other."""
    moments, found = second_moments(phantom), consistent_mass(phantom, 1.0).matrix.toarray()
    for first in np.unique(phantom.part[phantom.split]):
        own = moments[phantom.part == first].sum(axis=0)
        corners = phantom.mesh.points[phantom.mesh.cells[phantom.parent[first]]]
        nodes = phantom.cells[first]
        found[np.ix_(nodes, nodes)] += raised(own, corners, phantom.part_fraction[first])
    return found


def raised_eigenvalues(own, _corners, _share):
    values, modes = np.linalg.eigh(own)
    weak = modes[:, values < 1e-3 * values[-1]]
    return 1e-3 * values[-1] * weak @ weak.T


def raised_generalised_eigenvalues(own, corners, share):
    """Energy of the gradient of linear functions with the values of the identity at the corners."""
    volume = 0.5 * abs(np.linalg.det(corners[1:] - corners[0]))
    slopes = np.linalg.solve(np.column_stack([np.ones(3), corners]), np.eye(3))[1:]
    energy, whole = volume * slopes.T @ slopes, volume * (np.ones((3, 3)) + np.eye(3)) / 12.0
    limit = eigh(energy, whole, eigvals_only=True)[-1]
    values, modes = eigh(share * energy, own)
    fast = values > limit
    moved = own @ modes[:, fast]
    return moved @ np.diag(values[fast] / limit - 1.0) @ moved.T


STABILISED = [
    (eigenvalue_stabilised_mass, raised_eigenvalues),
    (generalised_eigenvalue_stabilised_mass, raised_generalised_eigenvalues),
]


@pytest.mark.parametrize(("mass", "raised"), STABILISED)
@pytest.mark.parametrize("off", [1e-3, 0.05])
def test_pieces_that_no_cut_keeps_apart_are_one_cell_to_a_stabilised_mass(mass, raised, off):
    """Planes past the point of a fork cut thin pieces off thick parts: no elements of their own."""
    cuts = fork(np.array([0.375, 0.5 + off]), np.array([0.3, 2.2, 4.5]))
    v = cut_mesh(rectangle_mesh((4, 4)), cuts)
    assert (v.part != np.arange(len(v.part))).any()
    expected = mass_by_parts(v, raised)
    found = mass(v, 1.0).matrix.toarray()
    np.testing.assert_allclose(found, expected, atol=1e-11 * expected.max())


@pytest.mark.parametrize("mass", [mass for mass, _ in STABILISED])
def test_a_cell_whose_pieces_are_all_joined_has_the_mass_of_an_uncut_one(mass):
    """Of a fork only one ray leaves the element: it ends there, and divides nothing."""
    point, angles = np.array([0.49849732, 0.47436723]), np.array([3.9912, 5.6559, 7.7417])
    ends = point + 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=1) * [[1], [0.03], [0.03]]
    v = cut_mesh(rectangle_mesh((4, 4)), [Polyline([point, end]) for end in ends])
    whole = v.split & (v.part_fraction > 1.0 - 1e-12)
    assert v.fraction[whole].min() < 1e-3
    added = (mass(v, 1.0).matrix - consistent_mass(v, 1.0).matrix).toarray()
    only = np.setdiff1d(v.cells[whole], v.cells[v.split & ~whole])
    assert len(only)
    assert abs(added[only]).max() < 1e-16
