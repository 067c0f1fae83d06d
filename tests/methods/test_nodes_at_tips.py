"""Ends of cuts inside elements as nodes of the mesh: where they are, and that nothing else changes.

Cracks lie at random in meshes with shaken nodes: every end has its own place in its element.
"""

import numpy as np
import pytest
from cut_bodies import shaken
from test_tips_beside_cuts import exterior, facet_measures
from xfem_bodies import boundary_nodes, scaled_dense_stiffness, sparse_stiffness, zero_modes

import verify.xfem as xfem
from verify.methods.tip_nodes import with_tip_nodes
from verify.scene import Scene, load_scene
from verify.solution import Regularisation
from verify.solvers import find_solver
from verify.xfem.mesh import Diagonal

SOFT = xfem.isotropic(1.0, 0.3, "plane strain")
SEEDS = [*range(4), *(pytest.param(n, marks=pytest.mark.heavy) for n in range(4, 50))]
LEAST = 0.15  # share of each part in its element


def crack(seed):
    """A shaken mesh of 8 × 8 squares and the ends of a crack in it."""
    random = np.random.default_rng(seed)
    turn, centre = random.uniform(0.0, np.pi), random.uniform(0.4, 0.6, 2)
    along = 0.3 * np.array([np.cos(turn), np.sin(turn)])
    ends = centre + random.uniform(0.7, 1.0, (2, 1)) * [-along, along]
    return shaken(xfem.rectangle_mesh((8, 8)), seed, 0.2 * (seed % 2)), ends


def tipped(seed):
    mesh, ends = crack(seed)
    nodes = with_tip_nodes(mesh, [xfem.Polyline(ends)])
    return mesh, ends, nodes, xfem.cut_mesh(nodes.mesh, nodes.cuts)


def held(phantom, field):
    supports = xfem.Supports.none(phantom)
    return supports.prescribe(phantom, boundary_nodes(phantom.mesh), field)


@pytest.mark.parametrize("seed", SEEDS)
def test_both_ends_become_nodes_and_no_part_is_small(seed):
    mesh, ends, nodes, phantom = tipped(seed)
    longest = mesh.longest_edges(np.arange(len(mesh.cells))).max()
    assert len(nodes.moved) == 2
    split = np.flatnonzero(phantom.fraction < 1.0)
    for end in ends:
        place = min(nodes.cuts[0].ends, key=lambda one: np.linalg.norm(one - end))
        (tip,) = np.flatnonzero((nodes.mesh.points == place).all(axis=1))
        off = place - end
        # to the nearest edge and along it, at worst; ahead four times as far costs as much
        limit = np.hypot(LEAST, LEAST) * longest
        ahead = off @ (end - ends.mean(axis=0)) >= 0.0
        assert np.linalg.norm(off) <= (4.0 if ahead else 1.0) * limit
        # the jump is zero at the end and linear up to it: behind its end the cut goes through one
        # triangle, whose corner at the end is one unknown
        one, other = split[(nodes.mesh.cells[phantom.parent[split]] == tip).any(axis=1)]
        assert phantom.parent[one] == phantom.parent[other]
        joined = phantom.cells[one] == phantom.cells[other]
        assert joined.tolist() == (nodes.mesh.cells[phantom.parent[one]] == tip).tolist()
        assert (phantom.node_parent == tip).sum() == 1
    assert nodes.mesh.measures.sum() == pytest.approx(mesh.measures.sum(), rel=1e-13)
    assert nodes.mesh.measures.min() >= 0.999 * LEAST * mesh.measures.min()
    assert_nothing_hangs(phantom, 1)
    values, before = (
        np.linalg.eigvalsh(scaled_dense_stiffness(one))
        for one in (phantom, xfem.cut_mesh(mesh, [xfem.Polyline(ends)]))
    )
    # the scaled matrix does not see the size of parts
    assert values[-1] / values[3] < 2.0 * before[-1] / before[3]


def assert_nothing_hangs(phantom, bodies):
    """Rigid motions only, and no facet outside but of the outline and of both faces of the cut."""
    zero, gap = zero_modes(phantom)
    assert zero == 3 * bodies
    assert gap > 1e-6
    divided = xfem.subdivide(phantom)
    torn = facet_measures(divided.cut_facets).sum()
    assert exterior(divided) == pytest.approx(4.0 + 2.0 * torn, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_pull_along_the_crack_is_linear_to_round_off_and_what_opens_further_stores_less(seed):
    """Uniaxial stress along the crack leaves its faces free and closed: no jump, a linear field."""
    mesh, ends, nodes, phantom = tipped(seed)
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    across = np.array([-along[1], along[0]])
    share = SOFT.lam / (SOFT.lam + 2.0 * SOFT.mu)
    strain = np.outer(along, along) - share * np.outer(across, across)
    straight = np.abs(xfem.Polyline(ends).level_set(nodes.cuts[0].ends)).max() < 1e-12
    if not straight:  # the last facet is not along the pull; a turn is linear all the same
        strain = np.array([[0.0, -1.0], [1.0, 0.0]])
    solution = xfem.solve_static(phantom, SOFT, held(phantom, lambda x, _sides=None: x @ strain.T))
    assert solution.displacement == pytest.approx(phantom.node_points @ strain.T, abs=1e-11)
    if straight:  # the space contains that of the rule "inside"
        pull = np.outer(across, across)
        inside = xfem.cut_mesh(mesh, [xfem.Polyline(ends)])
        mine, other = (
            xfem.solve_static(one, SOFT, held(one, lambda x, _sides=None: x @ pull)).strain_energy
            for one in (phantom, inside)
        )
        assert mine < other


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_is_kept_and_the_critical_step_falls_with_the_height_of_the_parts_at_most(seed):
    mesh, ends, _, phantom = tipped(seed)
    inside = xfem.cut_mesh(mesh, [xfem.Polyline(ends)])
    mass, before = (xfem.side_wise_mass(one, 2.0) for one in (phantom, inside))
    assert mass.weights.sum() == pytest.approx(2.0, rel=1e-12)
    assert mass.weights @ phantom.node_points == pytest.approx([1.0, 1.0], rel=1e-2)
    step = xfem.critical_step(sparse_stiffness(phantom), mass)
    least = xfem.critical_step(sparse_stiffness(inside), before)
    assert LEAST * least < step <= 1.001 * least


def test_ends_at_nodes_on_edges_and_outside_need_no_division_of_elements():
    mesh = xfem.rectangle_mesh((4, 4))
    nodes = with_tip_nodes(mesh, [xfem.Polyline([[-1.0, 0.5], [0.75, 0.5]])])
    assert np.array_equal(nodes.mesh.points, mesh.points)
    assert nodes.moved.max() < 1e-12
    nodes = with_tip_nodes(mesh, [xfem.Polyline([[-1.0, 0.45], [0.66, 0.45]])])
    assert len(nodes.mesh.points) == len(mesh.points) + 1
    through = [xfem.Polyline([[0.0, 0.4], [1.0, 0.6]])]  # from outline to outline
    assert len(with_tip_nodes(mesh, through).moved) == 0
    assert len(with_tip_nodes(mesh, []).moved) == 0


def test_a_branch_keeps_its_end_on_the_cut_from_which_it_leaves():
    mesh = xfem.rectangle_mesh((8, 8))
    stem, branch = (
        xfem.Polyline([[0.2, 0.53], [0.83, 0.53]]),
        xfem.Polyline([[0.51, 0.53], [0.51, 0.83]]),
    )
    nodes = with_tip_nodes(mesh, [stem, branch])
    assert len(nodes.moved) == 3
    assert (np.linalg.norm(nodes.cuts[1].ends - [0.51, 0.83], axis=1) < 0.1).all()
    asked, given = xfem.cut_mesh(nodes.mesh, nodes.cuts), xfem.cut_mesh(mesh, [stem, branch])
    assert len(np.unique(asked.bodies)) == len(np.unique(given.bodies)) == 1
    assert zero_modes(asked)[0] == 3


def test_a_cut_that_opens_during_a_motion_keeps_the_energy():
    """The ends are nodes from the start on; what opens later inherits the fields as they are."""
    scene = load_scene("dynamics/plate_cut_vibrating")
    found = find_solver("xfem").solve(scene, 0, 1, tip="partial", scheme="newmark")
    total = found.ledger["total"]
    assert total == pytest.approx(np.full(len(total), total[0]), rel=1e-9)
    kinds = [one.kind for one in found.regularisations]
    assert "end of a cut made a node" in kinds


@pytest.mark.parametrize("seed", range(2))
def test_an_end_made_a_node_is_not_reported_as_moved_to_an_edge_too(seed):
    """A crack anywhere in the body: what moves either end to its node is said once."""
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    turn, half = np.random.default_rng(seed).uniform([0.0, 0.5], [np.pi, 0.9])
    along = half * np.array([np.cos(turn), np.sin(turn)])
    ends = np.random.default_rng(seed).uniform(-0.3, 0.3, 2) + np.stack([-along, along])
    content["cuts"] = [{"kind": "polyline", "points": ends.tolist()}]
    content["exact"]["parameters"] |= {
        "centre": ends.mean(axis=0).tolist(), "a": half, "angle": np.rad2deg(turn)
    }  # fmt: skip
    solution = find_solver("xfem").solve(Scene.model_validate(content), 0, 0, tip="partial")
    said = [one for one in solution.regularisations if one.kind.startswith("end of a cut")]
    assert [(one.kind, one.count) for one in said] == [("end of a cut made a node", 2)]
    assert type(said[0]) is Regularisation
    assert said[0].size > 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_new_nodes_leave_other_cuts_as_they_were(seed):
    """Two straight cracks anywhere: as many bodies as before, no mechanism, no hanging node."""
    random = np.random.default_rng(seed)
    mesh = shaken(xfem.rectangle_mesh((5, 5)), seed)
    cuts = [xfem.Polyline(random.uniform(0.05, 0.95, (2, 2))) for _ in range(2)]
    nodes = with_tip_nodes(mesh, cuts)
    before, after = xfem.cut_mesh(mesh, cuts), xfem.cut_mesh(nodes.mesh, nodes.cuts)
    assert_nothing_hangs(after, before.bodies.max() + 1)
    levels = [cut.level_set(nodes.mesh.points[: len(mesh.points)]) for cut in nodes.cuts]
    asked = np.array([cut.level_set(mesh.points) for cut in cuts])
    assert (np.array(levels) != asked).sum() <= len(nodes.moved)  # nodes that are ends, no others


@pytest.mark.parametrize(
    ("diagonal", "vertices"),
    [
        ("right", [[0.23, 0.608], [0.26, 0.435], [0.698, 0.498], [0.389, 0.811]]),
        ("left", [[0.165, 0.233], [0.664, 0.119], [0.571, 0.379], [0.701, 0.741], [0.193, 0.42]]),
    ],
)
def test_an_end_beside_another_part_of_its_cut_does_not_close_it_to_a_loop(diagonal, vertices):
    mesh, cut = xfem.rectangle_mesh((4, 4), diagonal=diagonal), xfem.Polyline(vertices)
    nodes = with_tip_nodes(mesh, [cut])
    phantom = xfem.cut_mesh(nodes.mesh, nodes.cuts)
    assert phantom.bodies.max() == xfem.cut_mesh(mesh, [cut]).bodies.max() == 0
    for end in nodes.cuts[0].ends:
        (node,) = np.flatnonzero((nodes.mesh.points == end).all(axis=1))
        assert np.count_nonzero(phantom.node_parent == node) == 1


def moved(points, cells, cuts, axes, random):
    """A mesh and its cuts with other axes, nodes and cells numbered anew."""
    order = random.permutation(len(points))
    cells = random.permuted(random.permutation(np.argsort(order)[cells]), axis=1)
    return xfem.SimplexMesh((points @ axes.T)[order], cells), [
        xfem.Polyline(cut @ axes.T) for cut in cuts
    ]


def in_general_position(random):
    """Two cuts of about an element, close to each other."""
    count = int(random.integers(4, 8))
    mesh = shaken(xfem.rectangle_mesh((count, count)), int(random.integers(100)), 0.3)
    cuts = []
    for _ in range(2):
        along = random.uniform(0.2, 0.8) / count * np.exp(1j * random.uniform(0.0, np.pi))
        along = np.array([along.real, along.imag])
        centre = 0.5 + random.uniform(-0.7, 0.7, 2) / count
        kink = centre + random.uniform(-0.3, 0.3) * along[::-1] * [-1.0, 1.0]
        cuts.append(np.array([centre - along, kink, centre + along]))
    return mesh, cuts


def on_a_lattice(random):
    """One or two cuts between nodes and places on edges, along the edges too."""
    count, parts = int(random.integers(4, 8)), int(random.integers(1, 6))
    diagonals: tuple[Diagonal, ...] = ("right", "left", "alternating", "crossed")
    mesh = xfem.rectangle_mesh((count, count), diagonal=diagonals[random.integers(4)])
    cuts: list[np.ndarray] = []
    while len(cuts) < 2:
        cut = random.integers(1, count * parts, (random.integers(2, 4), 2)) / (parts * count)
        cut[1, random.integers(2)] = cut[0, 0]
        try:
            xfem.Polyline(cut)
        except xfem.XfemError:  # no length, or it meets itself
            continue
        cuts.append(cut)
    return mesh, cuts


@pytest.mark.parametrize("bodies", [in_general_position, on_a_lattice])
def test_ends_depend_neither_on_numbers_nor_on_the_axes(bodies):
    """Each end is the same place of the body in mirrored axes and in a mesh numbered anew."""
    random = np.random.default_rng(1)
    for _ in range(40):
        mesh, cuts = bodies(random)
        found = []
        for axes in (np.eye(2), np.diag([-1.0, 1.0]), np.eye(2)[::-1]):
            nodes = with_tip_nodes(*moved(mesh.points, mesh.cells, cuts, axes, random))
            ends = [np.reshape(cut.ends, (-1, 2)) @ axes for cut in nodes.cuts]
            found.append([one[np.lexsort(one.round(9).T)] for one in ends])
        for other in found[1:]:
            for given, same in zip(found[0], other, strict=True):
                np.testing.assert_allclose(same, given, rtol=0.0, atol=1e-9)


def test_an_end_at_a_node_stays_there_beside_another_one():
    """A cut along one edge of the mesh: both of its ends are at the nodes of that edge."""
    mesh = xfem.rectangle_mesh((4, 4))
    nodes = with_tip_nodes(mesh, [xfem.Polyline([[0.5, 0.5], [0.5, 0.25]])])
    assert np.array_equal(nodes.mesh.points, mesh.points)
    assert sorted(nodes.cuts[0].ends.tolist()) == [[0.5, 0.25], [0.5, 0.5]]
