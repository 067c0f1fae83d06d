"""Sliver policies: nothing lost, halves separate, exact where it was, bounded where it was not."""

from math import factorial

import numpy as np
import pytest
import xfem_exact_fields as exact
from cut_bodies import shaken
from test_sliver_conditioning import body, clamped
from xfem_bodies import boundary_nodes, relative_l2_error

import verify.xfem as xfem
from verify.xfem.cuts import ImplicitCut
from verify.xfem.mass import consistent_mass
from verify.xfem.slivers import DEFAULT_THRESHOLD

POLICIES = ["keep", "drop", "merge"]


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("dim", [2, 3])
def test_the_halves_stay_separate(dim, policy):
    """Two bodies; one half moves rigidly at no energy while the other is held."""
    for size in (1e-1, 1e-6, 1e-12, 0.0, -1e-12):
        phantom, _ = xfem.treat_slivers(body(dim, size), policy)
        assert phantom.bodies.max() == 1
        last = phantom.mesh.points[:, -1]
        lift = np.full(dim, 0.1)
        supports = clamped(phantom).prescribe(phantom, last > 1.0 - 1e-9, lift)
        solution = xfem.solve_static(phantom, xfem.isotropic(1.0, 0.3, "solid"), supports)
        assert solution.strain_energy < 1e-25
        lifted = solution.displacement[phantom.node_side[:, 0] > 0]
        assert np.abs(lifted - lift).max() < 1e-12


def solved_f3(mesh, policy):
    """Relative L2 error and strain energy of F3 (in space: as plane strain), slivers treated."""
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.5] * mesh.dim, [-1.0, 3.0, 0.0][: mesh.dim])])
    ends = np.isin(np.arange(len(mesh.points)), boundary_nodes(mesh))
    treated, report = xfem.treat_slivers(phantom, policy, supported=ends[phantom.node_parent])
    assert policy == "keep" or report.dropped + report.aggregated > 3

    def field(points, sides):
        plane = exact.f3(points[:, :2], sides)
        return np.pad(plane, ((0, 0), (0, points.shape[1] - 2)))

    supports = xfem.Supports.none(treated).prescribe(treated, boundary_nodes(mesh), field)
    state = "plane strain" if mesh.dim == 2 else "solid"
    solution = xfem.solve_static(treated, xfem.isotropic(1.0, 0.3, state), supports)
    return relative_l2_error(treated, solution.displacement, field), solution.strain_energy


@pytest.mark.parametrize(
    ("mesh", "policy"),
    [(xfem.rectangle_mesh((16, 16)), "drop"), (xfem.box_mesh((5, 5, 5)), "merge")],
)
def test_the_displacement_error_grows_by_less_than_two_percent(mesh, policy):
    """With a cut askew to shaken elements: slivers of all sizes."""
    mesh = shaken(mesh, 1)
    assert solved_f3(mesh, policy)[0] <= 1.02 * solved_f3(mesh, "keep")[0]


def test_with_aggregated_slivers_displacement_and_energy_keep_their_orders_and_errors():
    kept, found = (
        np.array([solved_f3(shaken(xfem.rectangle_mesh((n, n)), n), policy) for n in (8, 16, 32)])
        for policy in ("keep", "merge")
    )
    assert (found[:, 0] <= 1.02 * kept[:, 0]).all()
    # over all meshes: shaken ones differ from one to the next
    assert np.log2(found[0, 0] / found[-1, 0]) / 2.0 > 1.85
    # with exact values on the boundary the energy converges like the square of its norm
    excess = found[:, 1] - exact.ENERGY_F3
    assert np.log2(excess[0] / excess[-1]) / 4.0 > 0.95


@pytest.mark.parametrize("dim", [2, 3])
def test_a_corner_cut_off_by_a_sliver_is_given_back_or_counted(dim):
    """It is a body of its own, without a root on its side: dropped, or kept and counted."""
    mesh = xfem.rectangle_mesh((3, 3)) if dim == 2 else xfem.box_mesh((3, 3, 3))
    for size in (1e-1, 1e-2, 1e-4):
        corner = np.ones(dim) - size / 3.0 * np.eye(dim)[0]
        phantom = xfem.cut_mesh(mesh, [xfem.Plane(corner, np.arange(1.0, dim + 1.0))])
        assert phantom.bodies.max() == 1
        small = (phantom.fraction < DEFAULT_THRESHOLD).sum()
        treated, report = xfem.treat_slivers(phantom, "drop")
        assert treated.bodies.max() == 0
        assert (report.dropped, report.aggregated) == (small, 0)
        # nothing is left of the cut: the uncut mesh again
        assert treated.node_count == len(mesh.points)
        assert len(xfem.subdivide(treated).cut_facets) == 0
        treated, report = xfem.treat_slivers(phantom, "merge")
        assert treated is phantom
        assert (report.rootless, report.kept, report.aggregated) == (small, small, 0)


@pytest.mark.parametrize("policy", ["drop", "merge"])
def test_a_thin_neck_that_alone_holds_two_parts_together_is_kept(policy):
    """A strip between two cuts, 2 % of an element thick in its middle and thick at both ends."""
    lower = ImplicitCut(lambda x: x[:, 1] - 0.51)
    upper = ImplicitCut(lambda x: x[:, 1] - 0.5125 - np.maximum(np.abs(x[:, 0] - 0.5) - 0.2, 0.0))
    phantom = xfem.cut_mesh(xfem.rectangle_mesh((8, 8)), [lower, upper])
    treated, report = xfem.treat_slivers(phantom, policy)
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
        cuts.append(xfem.Plane(point + off * normal, normal))
    return cuts


@pytest.mark.parametrize("policy", ["drop", "merge"])
@pytest.mark.parametrize("dim", [2, 3])
def test_any_crossing_and_degenerate_cuts_keep_volume_mass_loads_points_and_bodies(dim, policy):
    """Slivers beside slivers, in parallelograms too; sums to round-off of as many terms."""
    absorbed = 0
    for seed in range(6):
        mesh = xfem.rectangle_mesh((5, 5)) if dim == 2 else xfem.box_mesh((3, 3, 3))
        mesh = shaken(mesh, seed) if seed % 3 else mesh
        phantom = xfem.cut_mesh(mesh, degenerate_cuts(mesh, seed))
        for threshold in (DEFAULT_THRESHOLD, 0.4):
            treated, report = xfem.treat_slivers(phantom, policy, threshold)
            absorbed += report.dropped + report.aggregated
            assert treated.volumes.sum() == pytest.approx(1.0, abs=1e-12)
            assert treated.shape_integrals.sum() == pytest.approx(1.0, abs=1e-12)
            assert xfem.side_wise_mass(treated, 3.0).weights.sum() == pytest.approx(3.0, abs=1e-12)
            assert consistent_mass(treated, 3.0).matrix.sum() == pytest.approx(3.0, abs=1e-12)
            pulled = xfem.traction(treated, mesh.boundary_facets, np.ones(dim))
            assert pulled.sum(axis=0) == pytest.approx(np.full(dim, 2.0 * dim), abs=1e-12)
            divided = xfem.subdivide(treated)
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
    assert absorbed > 30 * dim
