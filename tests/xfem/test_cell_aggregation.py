"""Cell aggregation: exact where it was, the order where it was, any cut, mesh and dimension."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from cut_bodies import rotation, shaken
from test_sliver_policies import degenerate_cuts
from xfem_bodies import boundary_nodes, relative_l2_error

from verify.xfem.arrays import XfemError
from verify.xfem.block_pattern import body_pattern, find_places
from verify.xfem.cuts import Plane
from verify.xfem.element import isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports, body_force, simplex_rule
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import subdivide

SOFT = {2: isotropic(1.0, 0.3, "plane strain"), 3: isotropic(1.0, 0.3, "solid")}


def aggregated(phantom, nodes=()):
    """Default policy, with a support at some nodes of the uncut mesh."""
    held = np.zeros(len(phantom.mesh.points), dtype=bool)
    held[np.asarray(nodes, dtype=int)] = True
    return treat_slivers(phantom, supported=held[phantom.node_parent])


def mesh_of(dim, count, seed):
    mesh = rectangle_mesh((count,) * 2) if dim == 2 else box_mesh((count,) * 3)
    return shaken(mesh, seed) if seed % 2 else mesh


def random_cut(mesh, random):
    """A plane anywhere, a third of them 1e-13 … 1e-2 off a node."""
    normal = random.normal(size=mesh.dim)
    if random.random() < 0.33:
        off = 10.0 ** -random.integers(2, 14) / np.linalg.norm(normal)
        return Plane(mesh.points[random.integers(len(mesh.points))] + off * normal, normal)
    return Plane(random.uniform(0.3, 0.7, mesh.dim), normal)


def stretched_sides(cut, random):
    """F1 for any plane: constant stress that the cut does not feel, another one on each side."""
    dim = len(cut.normal)
    frame = np.linalg.qr(np.column_stack([cut.normal, random.normal(size=(dim, dim - 1))]))[0]
    sides = []
    for _ in range(2):
        along = 0.1 * random.normal(size=dim - 1)
        strain = frame @ np.diag([-exact.ETA * along.sum(), *along]) @ frame.T
        sides.append((strain, 0.02 * random.normal(size=dim)))

    def field(points, labels):
        below, above = ((points - cut.point) @ strain + shift for strain, shift in sides)
        return np.where(labels[:, :1] > 0, above, below)

    return field


@pytest.mark.parametrize("dim,count", [(2, 8), (2, 17), (3, 3), (3, 4)])
def test_the_patch_test_holds_for_any_cut(dim, count):
    """Slivers kept and aggregated, of 1e-13 too; on the boundary prescribed; to round-off."""
    following = 0
    for seed in range(24):
        random = np.random.default_rng(seed)
        mesh = mesh_of(dim, count, seed)
        cut = random_cut(mesh, random)
        phantom = cut_mesh(mesh, [cut])
        treated, report = aggregated(phantom, boundary_nodes(mesh))
        following += report.aggregated
        field = stretched_sides(cut, random)
        for body in (phantom, treated):
            supports = Supports.none(body).prescribe(body, boundary_nodes(mesh), field)
            solution = solve_static(body, SOFT[dim], supports)
            want = field(body.node_points, body.node_side)
            assert np.abs(solution.displacement - want).max() < 1e-13
        # also where there is no unknown
        everywhere = field(phantom.node_points, phantom.node_side)
        assert np.abs(treated.extend(solution.displacement) - everywhere).max() < 1e-12
    assert following > 24 * 3


@pytest.mark.parametrize("dim,count", [(2, 12), (3, 4)])
def test_the_patch_test_holds_without_values_on_slivers(dim, count):
    """Held at five corners of the uncut mesh away from the cut, pulled by the exact tractions.

    The wedges that the cut leaves on the boundary follow roots, several layers away.
    """
    for seed in range(8):
        random = np.random.default_rng(50 + seed)
        mesh = mesh_of(dim, count, seed)
        cut = Plane(random.uniform(0.4, 0.6, dim), np.eye(dim)[-1] + 0.1 * random.normal(size=dim))
        phantom = cut_mesh(mesh, [cut])
        field = stretched_sides(cut, random)
        far = np.abs(mesh.points[:, -1] - 0.5) > 0.5 - 1e-9
        treated, _ = treat_slivers(phantom, supported=far[phantom.node_parent])
        supports = Supports.none(treated).prescribe(treated, far, field)
        # what the exact stress asks of the other nodes: internal forces of the uncut policy
        everywhere = field(phantom.node_points, phantom.node_side)
        load = InternalForce(phantom, SOFT[dim], "linear").evaluate(everywhere)[0]
        solution = solve_static(treated, SOFT[dim], supports, treated.restrict(load))
        want = field(treated.node_points, treated.node_side)
        assert np.abs(solution.displacement - want).max() < 1e-12


def turned_f3(angle):
    """F3 with its cut turned about the middle of the square; constant along a third axis."""
    turn = rotation(2, angle)

    def field(points, sides):
        plane = exact.f3((points[:, :2] - 0.5) @ turn + 0.5, sides) @ turn.T
        return np.pad(plane, ((0, 0), (0, points.shape[1] - 2)))

    return field, turn @ exact.ACROSS


def energy_error(phantom, displacement, field):
    """√∫ 2μ|ε|² + λ tr² of the error; exact strains by central differences, to 1e-9."""
    body, mesh = subdivide(phantom), phantom.mesh
    corners, sides = body.points[body.cells], phantom.piece_side[body.cell_piece]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (2 if mesh.dim == 2 else 6)
    nodal = phantom.extend(displacement)[phantom.cells]
    slopes = np.einsum("pik,pil->pkl", nodal, mesh.gradients[phantom.parent])[body.cell_piece]
    total = 0.0
    for point, weight in zip(*simplex_rule(mesh.dim, 4), strict=True):
        at = np.einsum("k,ckd->cd", point, corners)
        steps = 1e-5 * np.eye(mesh.dim)
        want = np.stack([(field(at + h, sides) - field(at - h, sides)) / 2e-5 for h in steps], 2)
        strain = 0.5 * (slopes - want + (slopes - want).transpose(0, 2, 1))
        density = 2.0 * exact.MU * (strain**2).sum(axis=(1, 2))
        density += exact.LAMBDA * np.trace(strain, axis1=1, axis2=2) ** 2
        total += weight * volumes @ density
    return np.sqrt(total)


def errors_kept_and_aggregated(mesh, angle):
    """L2 and energy errors (2, 2), with slivers kept and aggregated."""
    field, normal = turned_f3(angle)
    ends = boundary_nodes(mesh)
    phantom = cut_mesh(mesh, [Plane([0.5] * mesh.dim, np.pad(normal, (0, mesh.dim - 2)))])
    treated, report = aggregated(phantom, ends)
    assert report.aggregated > 0
    found = []
    for body in (phantom, treated):
        supports = Supports.none(body).prescribe(body, ends, field)
        moved = solve_static(body, SOFT[mesh.dim], supports).displacement
        found.append((relative_l2_error(body, moved, field), energy_error(body, moved, field)))
    return np.array(found)


def check_order(counts, angle, seed):
    """Order 2 in L2 and 1 in energy, both errors within 2 % of those of slivers that are kept."""
    errors = np.array(
        [errors_kept_and_aggregated(mesh_of(2, n, seed + 2 * n), angle) for n in counts]
    )
    assert (errors[:, 1] / errors[:, 0]).max() < 1.02
    # over all counts: shaken meshes differ from one to the next
    orders = np.log2(errors[0, 1] / errors[-1, 1]) / np.log2(counts[-1] / counts[0])
    assert orders[0] > 1.85
    assert orders[1] > 0.95


@pytest.mark.parametrize("angle", [0.3, 1.3])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_displacement_keeps_its_order_and_its_error(angle, seed):
    """F3 on structured and shaken squares, the cut askew to both."""
    check_order((8, 16, 32), angle, seed)


def dense_stiffness(phantom):
    pattern = body_pattern(phantom)
    blocks = InternalForce(phantom, SOFT[phantom.mesh.dim], "linear").stiffness(pattern)
    return pattern.matrix(blocks).toarray()


@pytest.mark.parametrize("seed", range(12))
def test_bodies_and_rigid_motions_stay_what_they_are(seed):
    """Up to four cuts at random: 3 or 6 motions without energy for each part, and no other."""
    dim = 2 + seed % 2
    mesh = mesh_of(dim, 5 if dim == 2 else 3, seed // 2)
    phantom = cut_mesh(mesh, degenerate_cuts(mesh, seed))
    treated, report = treat_slivers(phantom)
    assert treated.bodies.max() == phantom.bodies.max()
    K = dense_stiffness(treated)
    # what the matrix must be: Cᵀ K C, from a product of dense matrices
    C = np.kron(report.extension.toarray(), np.eye(dim))
    want = C.T @ dense_stiffness(phantom) @ C
    assert np.abs(K - want).max() < 1e-14 * np.abs(want).max()
    scale = 1.0 / np.sqrt(np.diag(K))
    values = np.linalg.eigvalsh(scale[:, None] * K * scale)
    parts = phantom.bodies.max() + 1
    assert (np.abs(values) < 1e-11).sum() == (3 if dim == 2 else 6) * parts


def test_couplings_that_no_cell_has_enter_an_aggregated_matrix_both_ways():
    mesh = rectangle_mesh((5, 5))
    treated, report = treat_slivers(cut_mesh(mesh, [Plane([0.401, 0.5], [1.0, 0.0])]))
    first, last = np.array([0]), np.array([len(mesh.points) - 1])
    assert report.aggregated > 0
    assert not find_places(body_pattern(treated), first, last)[1].any()
    coupled = body_pattern(treated, np.stack([first, last], axis=1))
    assert find_places(coupled, first, last)[1].all()
    assert find_places(coupled, last, first)[1].all()


def near_nodes(dim, size):
    """Plane size·h above nodes, askew to the mesh: slivers of all shapes around one node."""
    mesh = mesh_of(dim, 8 if dim == 2 else 4, 1)
    middle = np.abs(mesh.points - 0.5).sum(axis=1).argmin()
    normal = np.array([0.3, 1.0] if dim == 2 else [0.3, -0.2, 1.0])
    return cut_mesh(mesh, [Plane(mesh.points[middle] + size / 8 * normal, normal)])


@pytest.mark.parametrize("dim", [2, 3])
def test_the_condition_number_without_scaling_is_bounded(dim):
    """At most twenty times that of the same mesh uncut, for slivers of any size and none.

    What is left to stand on its own is a tenth of its element at least, which costs up to ten
    times; a root is continued to twice its size. Kept, it grows without limit.
    """

    def condition(phantom):
        held = np.repeat(phantom.node_points[:, -1] % 1.0 < 1e-9, dim)
        values = np.linalg.eigvalsh(dense_stiffness(phantom)[np.ix_(~held, ~held)])
        return values[-1] / values[0]

    uncut = condition(cut_mesh(near_nodes(dim, 0.5).mesh, []))
    for size in (0.3, 1e-1, 1e-2, 1e-4, 1e-8, 1e-12, 0.0, -1e-12, -1e-8, -1e-4):
        phantom = near_nodes(dim, size)
        ends = phantom.node_points[:, -1] % 1.0 < 1e-9
        treated, _ = treat_slivers(phantom, supported=ends)
        assert condition(treated) < 20.0 * uncut
    assert condition(near_nodes(dim, 1e-4)) > 1e4 * uncut


@pytest.mark.parametrize("policy", ["keep", "merge"])
def test_prescribed_values_on_slivers_are_what_they_are(policy):
    """A thin wedge between cut and boundary is pulled by its sharp end, where only slivers are."""
    mesh = rectangle_mesh((8, 8))
    phantom = cut_mesh(mesh, [Plane([1.0, 0.9995], [-0.06, 1.0])])
    tip = (mesh.points > 0.87).all(axis=1) & (mesh.points[:, 1] == 1.0)
    base = mesh.points[:, 1] == 0.0
    held = (tip | base)[phantom.node_parent]
    treated, report = treat_slivers(phantom, policy, supported=held)
    assert (report.aggregated > 0) == (policy == "merge")
    supports = Supports.none(treated).prescribe(treated, base)
    supports = supports.prescribe(treated, tip, lambda x, side: 0.01 * x)
    solution = solve_static(treated, SOFT[2], supports)
    at = np.flatnonzero(tip[phantom.node_parent])
    values = treated.extend(solution.displacement)[at]
    assert values == pytest.approx(0.01 * phantom.node_points[at], abs=1e-15)
    if policy == "merge":
        plain, _ = treat_slivers(phantom, policy)
        with pytest.raises(XfemError, match="follow"):
            Supports.none(plain).prescribe(plain, tip)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_finite_rotation_costs_nothing_and_the_tangent_is_the_derivative(dim):
    treated, report = treat_slivers(near_nodes(dim, 1e-3))
    assert report.aggregated > 0
    force = InternalForce(treated, SOFT[dim])
    turned = treated.node_points @ (rotation(dim, 2.0) - np.eye(dim)).T + 0.3
    found, energy = force.evaluate(turned)
    assert energy < 1e-28
    assert np.abs(found).max() < 1e-14
    random = np.random.default_rng(0)
    u, w = 0.02 * random.normal(size=(2, treated.node_count, dim))
    pattern = body_pattern(treated)
    K = pattern.matrix(force.stiffness(pattern, u))
    (plus, above), (minus, below) = (force.evaluate(u + s * 1e-6 * w) for s in (1.0, -1.0))
    # central differences: h² of third derivatives, and round-off/h
    assert (above - below) / 2e-6 == pytest.approx(np.sum(force.evaluate(u)[0] * w), rel=1e-7)
    change = ((plus - minus) / 2e-6).ravel()
    assert np.abs(K @ w.ravel() - change).max() < 1e-6 * np.abs(change).max()


@pytest.mark.parametrize("dim", [2, 3])
def test_static_equilibrium_at_large_rotation_is_that_of_the_kept_slivers_but_for_their_share(dim):
    """Halves turned by half a radian against each other under their weight.

    Energies differ by less than what the aggregated slivers are of the volume.
    """
    phantom = near_nodes(dim, 1e-2)
    mesh = phantom.mesh
    ends = np.abs(mesh.points[:, -1] - 0.5) > 0.5 - 1e-9
    turn = rotation(dim, 0.5, (0.0, 0.0, 1.0)) - np.eye(dim)

    def energy(treated):
        supports = Supports.none(treated).prescribe(treated, ends)
        upper = (treated.node_points[:, -1] > 0.5)[:, None]
        load = body_force(treated, -0.02 * np.eye(dim)[0])

        def prescribed(share):
            return upper * share * (treated.node_points @ turn.T)

        force = InternalForce(treated, SOFT[dim])
        return static_equilibrium(force, supports.fixed, prescribed, load, 4).energy

    treated, report = treat_slivers(phantom, supported=ends[phantom.node_parent])
    assert report.aggregated > 0
    kept, found = energy(phantom), energy(treated)
    assert found == pytest.approx(kept, rel=report.volume_share)
