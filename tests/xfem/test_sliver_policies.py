"""Sliver policies: nothing lost, halves separate, exact where it was, bounded where it was not."""

from math import factorial

import numpy as np
import pytest
import xfem_exact_fields as exact
from cut_bodies import shaken
from test_sliver_conditioning import SLIVERS, body, clamped
from xfem_bodies import boundary_nodes, relative_l2_error

from verify.xfem.cuts import ImplicitCut, Plane
from verify.xfem.element import isotropic
from verify.xfem.loads_and_supports import Supports, traction
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import DEFAULT_THRESHOLD, treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import subdivide

POLICIES = ["keep", "drop", "merge"]


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("size", SLIVERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_the_halves_stay_separate(dim, size, policy):
    """Two bodies; one half moves rigidly at no energy while the other is held."""
    phantom, _ = treat_slivers(body(dim, size), policy)
    assert phantom.bodies.max() == 1
    last = phantom.mesh.points[:, -1]
    lift = np.full(dim, 0.1)
    supports = clamped(phantom).prescribe(phantom, last > 1.0 - 1e-9, lift)
    solution = solve_static(phantom, isotropic(1.0, 0.3, "solid"), supports)
    assert solution.strain_energy < 1e-25
    assert solution.displacement[phantom.node_side[:, 0] > 0] == pytest.approx(
        np.broadcast_to(lift, (np.sum(phantom.node_side[:, 0] > 0), dim)), abs=1e-12
    )


def solved_f3(mesh, policy):
    phantom = cut_mesh(mesh, [Plane([0.5] * mesh.dim, [-1.0, 3.0, 0.0][: mesh.dim])])
    ends = np.isin(np.arange(len(mesh.points)), boundary_nodes(mesh))
    treated, report = treat_slivers(phantom, policy, supported=ends[phantom.node_parent])

    def field(points, sides):
        plane = exact.f3(points[:, :2], sides)
        return np.pad(plane, ((0, 0), (0, points.shape[1] - 2)))

    supports = Supports.none(treated).prescribe(treated, boundary_nodes(mesh), field)
    state = "plane strain" if mesh.dim == 2 else "solid"
    solution = solve_static(treated, isotropic(1.0, 0.3, state), supports)
    return relative_l2_error(treated, solution.displacement, field), report


@pytest.mark.parametrize(
    "dim,count,policy",
    [(2, 16, "merge"), (2, 32, "merge"), (3, 6, "merge"), (2, 16, "drop"), (3, 6, "drop")],
)
def test_the_displacement_error_grows_by_less_than_two_percent(dim, count, policy):
    """F3 (in space: as plane strain) with a cut askew to shaken elements: slivers of all sizes."""
    absorbed = 0
    for seed in range(3):
        mesh = shaken(rectangle_mesh((count,) * 2) if dim == 2 else box_mesh((count,) * 3), seed)
        kept, _ = solved_f3(mesh, "keep")
        treated, report = solved_f3(mesh, policy)
        absorbed += report.dropped + report.aggregated
        assert treated <= 1.02 * kept
    assert absorbed > 10


@pytest.mark.parametrize("dim", [2, 3])
def test_a_corner_cut_off_by_a_sliver_is_given_back_or_counted(dim):
    """It is a body of its own, without a root on its side: dropped, or kept and counted."""
    mesh = rectangle_mesh((3, 3)) if dim == 2 else box_mesh((3, 3, 3))
    for size in (1e-1, 1e-2, 1e-4):
        corner = np.ones(dim) - size / 3.0 * np.eye(dim)[0]
        phantom = cut_mesh(mesh, [Plane(corner, np.arange(1.0, dim + 1.0))])
        assert phantom.bodies.max() == 1
        small = (phantom.fraction < DEFAULT_THRESHOLD).sum()
        treated, report = treat_slivers(phantom, "drop")
        assert treated.bodies.max() == 0
        assert (report.dropped, report.aggregated) == (small, 0)
        # nothing is left of the cut: the uncut mesh again
        assert treated.node_count == len(mesh.points)
        assert len(subdivide(treated).cut_facets) == 0
        treated, report = treat_slivers(phantom, "merge")
        assert treated is phantom
        assert (report.rootless, report.kept, report.aggregated) == (small, small, 0)


@pytest.mark.parametrize("policy", ["drop", "merge"])
def test_a_thin_neck_that_alone_holds_two_parts_together_is_kept(policy):
    """A strip between two cuts, 2 % of an element thick in its middle and thick at both ends."""
    lower = ImplicitCut(lambda x: x[:, 1] - 0.51)
    upper = ImplicitCut(lambda x: x[:, 1] - 0.5125 - np.maximum(np.abs(x[:, 0] - 0.5) - 0.2, 0.0))
    phantom = cut_mesh(rectangle_mesh((8, 8)), [lower, upper])
    treated, report = treat_slivers(phantom, policy)
    assert phantom.bodies.max() == treated.bodies.max() == 2
    assert report.kept > 0
    # what is no bridge is still treated
    assert report.kept < (phantom.fraction < DEFAULT_THRESHOLD).sum()


def degenerate_cuts(mesh, seed):
    """Up to four planes at random, many through nodes, along faces, or off them by 1e-13 … 1e-2."""
    random = np.random.default_rng(seed)
    dim, cuts = mesh.dim, []
    for _ in range(random.integers(1, 5)):
        at_node = random.random() < 0.5
        point = (
            mesh.points[random.integers(len(mesh.points))]
            if at_node
            else random.uniform(0.2, 0.8, dim)
        )
        along = random.random() < 0.4
        normal = np.eye(dim)[random.integers(dim)] if along else random.normal(size=dim)
        off = 10.0 ** -random.integers(2, 14) * (random.random() < 0.7)
        cuts.append(Plane(point + off * normal, normal))
    return cuts


@pytest.mark.parametrize("policy", ["drop", "merge"])
@pytest.mark.parametrize("dim", [2, 3])
def test_any_crossing_and_degenerate_cuts_keep_volume_mass_loads_points_and_bodies(dim, policy):
    """Slivers beside slivers, in parallelograms too; sums to round-off of as many terms."""
    absorbed = 0
    for seed in range(20):
        mesh = rectangle_mesh((5, 5)) if dim == 2 else box_mesh((3, 3, 3))
        mesh = shaken(mesh, seed) if seed % 3 else mesh
        phantom = cut_mesh(mesh, degenerate_cuts(mesh, seed))
        for threshold in (0.02, 0.1, 0.4):
            treated, report = treat_slivers(phantom, policy, threshold)
            absorbed += report.dropped + report.aggregated
            assert treated.volumes.sum() == pytest.approx(1.0, abs=1e-12)
            assert treated.shape_integrals.sum() == pytest.approx(1.0, abs=1e-12)
            assert side_wise_mass(treated, 3.0).weights.sum() == pytest.approx(3.0, abs=1e-12)
            assert consistent_mass(treated, 3.0).matrix.sum() == pytest.approx(3.0, abs=1e-12)
            pulled = traction(treated, mesh.boundary_facets, np.ones(dim))
            assert pulled.sum(axis=0) == pytest.approx(np.full(dim, 2.0 * dim), abs=1e-12)
            divided = subdivide(treated)
            corners = divided.points[divided.cells]
            volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / factorial(dim)
            assert volumes.min() >= 0.0
            assert volumes.sum() == pytest.approx(1.0, abs=1e-12)
            # a linear field is continued exactly
            moved = divided.interpolation @ treated.node_points
            assert np.abs(moved - divided.points).max() < 1e-12
            extended = report.extension @ treated.node_points
            assert np.abs(extended - phantom.node_points).max() < 1e-12
            if threshold == DEFAULT_THRESHOLD:  # what is left is no sliver, unless it is said
                left = (treated.fraction < threshold).sum()
                assert left <= report.kept + report.aggregated
            assert np.array_equal(np.unique(treated.cells), np.arange(treated.corners.node_count))
            assert treated.bodies.max() <= phantom.bodies.max()
    assert absorbed > 100 * dim
