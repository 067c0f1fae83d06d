"""Cell aggregation: exact where it was, the order where it was, any cut, mesh and dimension."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from cut_bodies import rotation, shaken
from test_sliver_policies import degenerate_cuts
from xfem_bodies import boundary_nodes

import verify.xfem as xfem
from verify.xfem.block_pattern import body_pattern

SOFT = {2: xfem.isotropic(1.0, 0.3, "plane strain"), 3: xfem.isotropic(1.0, 0.3, "solid")}


def aggregated(phantom, nodes=()):
    """Default policy, with a support at some nodes of the uncut mesh."""
    held = np.zeros(len(phantom.mesh.points), dtype=bool)
    held[np.asarray(nodes, dtype=int)] = True
    return xfem.treat_slivers(phantom, supported=held[phantom.node_parent])


def mesh_of(dim, count, seed):
    mesh = xfem.rectangle_mesh((count,) * 2) if dim == 2 else xfem.box_mesh((count,) * 3)
    return shaken(mesh, seed) if seed % 2 else mesh


def random_cut(mesh, random):
    """A plane anywhere, a third of them 1e-13 … 1e-2 off a node."""
    normal = random.normal(size=mesh.dim)
    if random.random() < 0.33:
        off = 10.0 ** -random.integers(2, 14) / np.linalg.norm(normal)
        return xfem.Plane(mesh.points[random.integers(len(mesh.points))] + off * normal, normal)
    return xfem.Plane(random.uniform(0.3, 0.7, mesh.dim), normal)


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


@pytest.mark.parametrize(("dim", "count"), [(2, 9), (3, 3)])
def test_the_patch_test_holds_for_any_cut(dim, count):
    """Slivers kept and aggregated, of 1e-13 too; on the boundary prescribed; to round-off."""
    following = 0
    for seed in range(8):
        random = np.random.default_rng(seed)
        mesh = mesh_of(dim, count, seed)
        cut = random_cut(mesh, random)
        phantom = xfem.cut_mesh(mesh, [cut])
        treated, report = aggregated(phantom, boundary_nodes(mesh))
        following += report.aggregated
        field = stretched_sides(cut, random)
        for body in (phantom, treated):
            supports = xfem.Supports.none(body).prescribe(body, boundary_nodes(mesh), field)
            solution = xfem.solve_static(body, SOFT[dim], supports)
            want = field(body.node_points, body.node_side)
            assert np.abs(solution.displacement - want).max() < 1e-13
        # also where there is no unknown
        everywhere = field(phantom.node_points, phantom.node_side)
        assert np.abs(treated.extend(solution.displacement) - everywhere).max() < 1e-12
    assert following > 8 * 2


@pytest.mark.parametrize(("dim", "count"), [(2, 12), (3, 4)])
def test_the_patch_test_holds_without_values_on_slivers(dim, count):
    """Held at five corners of the uncut mesh away from the cut, pulled by the exact tractions.

    The wedges that the cut leaves on the boundary follow roots, several layers away.
    """
    for seed in range(3):
        random = np.random.default_rng(50 + seed)
        mesh = mesh_of(dim, count, seed)
        cut = xfem.Plane(
            random.uniform(0.4, 0.6, dim), np.eye(dim)[-1] + 0.1 * random.normal(size=dim)
        )
        phantom = xfem.cut_mesh(mesh, [cut])
        field = stretched_sides(cut, random)
        far = np.abs(mesh.points[:, -1] - 0.5) > 0.5 - 1e-9
        treated, _ = xfem.treat_slivers(phantom, supported=far[phantom.node_parent])
        supports = xfem.Supports.none(treated).prescribe(treated, far, field)
        # what the exact stress asks of the other nodes: internal forces of the uncut policy
        everywhere = field(phantom.node_points, phantom.node_side)
        load = xfem.InternalForce(phantom, SOFT[dim], "linear").evaluate(everywhere)[0]
        solution = xfem.solve_static(treated, SOFT[dim], supports, treated.restrict(load))
        want = field(treated.node_points, treated.node_side)
        assert np.abs(solution.displacement - want).max() < 1e-12


def dense_stiffness(phantom):
    pattern = body_pattern(phantom)
    blocks = xfem.InternalForce(phantom, SOFT[phantom.mesh.dim], "linear").stiffness(pattern)
    return pattern.matrix(blocks).toarray()


@pytest.mark.parametrize("seed", range(4))
def test_bodies_and_rigid_motions_stay_what_they_are(seed):
    """Up to four cuts at random: 3 or 6 motions without energy for each part, and no other."""
    dim = 2 + seed % 2
    mesh = mesh_of(dim, 5 if dim == 2 else 3, seed // 2)
    phantom = xfem.cut_mesh(mesh, degenerate_cuts(mesh, seed))
    treated, report = xfem.treat_slivers(phantom)
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


def near_nodes(dim, size):
    """Plane size·h above nodes, askew to the mesh: slivers of all shapes around one node."""
    mesh = mesh_of(dim, 8 if dim == 2 else 4, 1)
    middle = np.abs(mesh.points - 0.5).sum(axis=1).argmin()
    normal = np.array([0.3, 1.0] if dim == 2 else [0.3, -0.2, 1.0])
    return xfem.cut_mesh(mesh, [xfem.Plane(mesh.points[middle] + size / 8 * normal, normal)])


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

    uncut = condition(xfem.cut_mesh(near_nodes(dim, 0.5).mesh, []))
    for size in (0.3, 1e-2, 1e-12, 0.0, -1e-8):
        phantom = near_nodes(dim, size)
        ends = phantom.node_points[:, -1] % 1.0 < 1e-9
        treated, _ = xfem.treat_slivers(phantom, supported=ends)
        assert condition(treated) < 20.0 * uncut
    assert condition(near_nodes(dim, 1e-4)) > 1e4 * uncut


@pytest.mark.parametrize("policy", ["keep", "merge"])
def test_prescribed_values_on_slivers_are_what_they_are(policy):
    """A thin wedge between cut and boundary is pulled by its sharp end, where only slivers are."""
    mesh = xfem.rectangle_mesh((8, 8))
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([1.0, 0.9995], [-0.06, 1.0])])
    tip = (mesh.points > 0.87).all(axis=1) & (mesh.points[:, 1] == 1.0)
    base = mesh.points[:, 1] == 0.0
    held = (tip | base)[phantom.node_parent]
    treated, report = xfem.treat_slivers(phantom, policy, supported=held)
    assert (report.aggregated > 0) == (policy == "merge")
    supports = xfem.Supports.none(treated).prescribe(treated, base)
    supports = supports.prescribe(treated, tip, lambda x, side: 0.01 * x)
    solution = xfem.solve_static(treated, SOFT[2], supports)
    at = np.flatnonzero(tip[phantom.node_parent])
    values = treated.extend(solution.displacement)[at]
    assert values == pytest.approx(0.01 * phantom.node_points[at], abs=1e-15)
    if policy == "merge":
        plain, _ = xfem.treat_slivers(phantom, policy)
        with pytest.raises(xfem.XfemError, match="follow"):
            xfem.Supports.none(plain).prescribe(plain, tip)


def test_static_equilibrium_at_large_rotation_is_that_of_the_kept_slivers_but_for_their_share():
    """Halves turned by half a radian against each other under their weight.

    Energies differ by less than what the aggregated slivers are of the volume.
    """
    dim, phantom = 3, near_nodes(3, 1e-2)
    mesh = phantom.mesh
    ends = np.abs(mesh.points[:, -1] - 0.5) > 0.5 - 1e-9
    turn = rotation(dim, 0.5, (0.0, 0.0, 1.0)) - np.eye(dim)

    def energy(treated):
        supports = xfem.Supports.none(treated).prescribe(treated, ends)
        upper = (treated.node_points[:, -1] > 0.5)[:, None]
        load = xfem.body_force(treated, -0.02 * np.eye(dim)[0])

        def prescribed(share):
            return upper * share * (treated.node_points @ turn.T)

        force = xfem.InternalForce(treated, SOFT[dim])
        return xfem.static_equilibrium(force, supports.fixed, prescribed, load, 4).energy

    treated, report = xfem.treat_slivers(phantom, supported=ends[phantom.node_parent])
    assert report.aggregated > 0
    kept, found = energy(phantom), energy(treated)
    assert found == pytest.approx(kept, rel=report.volume_share)
