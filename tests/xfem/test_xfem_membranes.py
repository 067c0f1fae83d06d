"""Membranes: stiffness, patch test, tension, hanging under weight, rims of their cuts."""

import numpy as np
import pytest
from cut_bodies import rotation
from xfem_bodies import boundary_nodes

from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane, ToolPath
from verify.xfem.element import isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.statics import NotInEquilibriumError, solve_static

MATERIAL = isotropic(1e4, 0.3, "plane stress")
TURN = rotation(3, 0.8)


def plate(turn=None):
    """The same cut plate in the plane, or in space and turned."""
    flat = rectangle_mesh((6, 5))
    point, normal = np.array([0.5, 0.53]), np.array([-0.3, 1.0])
    if turn is None:
        return cut_mesh(flat, [Plane(point, normal)])
    points = np.pad(flat.points, ((0, 0), (0, 1))) @ turn.T
    cut = Plane(turn @ np.append(point, 0.0), turn @ np.append(normal, 0.0))
    return cut_mesh(SimplexMesh(points, flat.cells), [cut])


def dense(phantom):
    pattern = block_pattern(phantom.cells, phantom.node_count)
    return pattern.matrix(InternalForce(phantom, MATERIAL, "linear").stiffness(pattern)).toarray()


def test_a_turned_membrane_has_the_turned_stiffness_of_the_plate_and_none_across():
    flat, membrane = plate(), plate(TURN)
    nodes = flat.node_count
    plane = dense(flat).reshape(nodes, 2, nodes, 2)
    space = np.einsum("ki,aibj,lj->akbl", TURN[:, :2], plane, TURN[:, :2])
    got = dense(membrane).reshape(nodes, 3, nodes, 3)
    assert got == pytest.approx(space, abs=1e-11 * np.abs(plane).max())


def test_each_half_of_a_cut_membrane_passes_the_patch_test_in_its_plane():
    """Constant strain along the cut, another one per half, free contraction across."""
    membrane = plate(np.eye(3))
    along = np.array([1.0, 0.3, 0.0]) / np.hypot(1.0, 0.3)
    across = np.array([-0.3, 1.0, 0.0]) / np.hypot(1.0, 0.3)

    def stretched(x, side):
        local = x - np.array([0.5, 0.53, 0.0])
        strain = np.where(side[:, 0] > 0, 0.1, -0.05)
        return (strain * (local @ along))[:, None] * along - (0.3 * strain * (local @ across))[
            :, None
        ] * across

    supports = Supports.none(membrane).prescribe(membrane, boundary_nodes(membrane.mesh), stretched)
    everywhere = np.ones(len(membrane.mesh.points), dtype=bool)
    supports = supports.prescribe(membrane, everywhere, components=(2,))
    solution = solve_static(membrane, MATERIAL, supports)
    want = stretched(membrane.node_points, membrane.node_side)
    assert solution.displacement == pytest.approx(want, abs=1e-14)
    area = 0.47  # above the cut, which passes through (.5, .53)
    energy = 0.5 * 1e4 * (0.1**2 * area + 0.05**2 * (1.0 - area))
    assert solution.strain_energy == pytest.approx(energy, rel=1e-12)


STIFFNESS, WEIGHT = 20.0, 19.6  # E times thickness, N/m; weight, N/m²


def cut_bowl(n):
    """A hanging bowl that is cut across, and which of its nodes are held: those of its rim."""
    flat = rectangle_mesh((n, n))
    x, y = flat.points.T
    points = np.column_stack([x, y, -3.0 * x * (1 - x) * y * (1 - y)])
    bowl = cut_mesh(SimplexMesh(points, flat.cells), [Plane([0.52, 0.5, 0.0], [1.0, -0.04, 0.0])])
    x, y = bowl.node_points[:, :2].T
    return bowl, (x == 0.0) | (x == 1.0) | (y == 0.0) | (y == 1.0)


def hang(phantom, poisson, held, load_steps=1, weight=WEIGHT):
    force = InternalForce(phantom, isotropic(STIFFNESS, poisson, "plane stress"))
    load = side_wise_mass(phantom, weight / 9.8).weight([0.0, 0.0, -9.8])
    return static_equilibrium(force, np.repeat(held[:, None], 3, axis=1), None, load, load_steps)


@pytest.mark.parametrize("n", [6, 24])
def test_a_cut_bowl_finds_its_equilibrium_in_one_load_step(n):
    """Parts of it are slack on their way: halving the residual ended at 7 % of the forces."""
    bowl, held = cut_bowl(n)
    found = hang(bowl, 0.3, held)
    # the exact stiffness ends it: a corner of held nodes, across which it is round-off below
    # zero, had it refused, and 31 corrections were needed, under three times the weight 504
    assert found.iterations[0] < 16
    assert hang(bowl, 0.3, held, weight=3.0 * WEIGHT).iterations[0] < 16
    pull = [0.0, 0.0, WEIGHT * bowl.volumes.sum()]
    assert found.reactions.sum(axis=0) == pytest.approx(pull, abs=1e-7)
    # and the same by another way there
    other = hang(bowl, 0.3, held, load_steps=3)
    assert other.energy == pytest.approx(found.energy, rel=1e-10)


def test_under_ten_times_its_weight_a_piece_of_the_bowl_is_named_that_has_narrowed_to_nothing():
    """It is stretched by more than 1 + 1/ν = 4.33; with a smaller ν the bowl finds its place."""
    bowl, held = cut_bowl(24)
    for poisson in (0.0, 0.1, 0.2):
        assert hang(bowl, poisson, held, weight=10.0 * WEIGHT).iterations[0] < 16
    with pytest.raises(NotInEquilibriumError, match="1 of 1199 pieces have collapsed"):
        hang(bowl, 0.3, held, weight=10.0 * WEIGHT)


SKIN = isotropic(1e3, 0.3, "plane stress")  # E times thickness, N/m


def _membrane(divisions=6):
    flat = rectangle_mesh((divisions, divisions))
    points = np.column_stack([flat.points, np.zeros(len(flat.points))])
    return cut_mesh(SimplexMesh(points, flat.cells), [Plane([0.5, 0.53, 0.0], [0.0, 1.0, 0.0])])


def _matrices(v, displacement, kinds):
    force = InternalForce(v, SKIN)
    pattern = block_pattern(v.cells, v.node_count)
    return [
        pattern.matrix(force.stiffness(pattern, displacement, kind)).toarray() for kind in kinds
    ]


def _turned(v, stretches, angle):
    Q, X = rotation(3, angle), v.node_points
    return X @ np.diag([*stretches, 1.0]) @ Q.T - X, Q[:, 2]


@pytest.mark.parametrize("angle", [0.0, 1.1])
def test_across_the_plane_of_a_stretched_membrane_the_stiffness_is_the_exact_one(angle):
    v = _membrane()
    u, normal = _turned(v, (1.2, 1.05), angle)
    exact, tensioned, frozen = _matrices(v, u, ("consistent", "geometric", "rotation-fixed"))
    across = np.kron(np.random.default_rng(0).normal(size=v.node_count), normal)
    size = np.abs(exact @ across).max()
    assert size > 1.0
    assert np.abs((exact - tensioned) @ across).max() < 1e-12 * size
    assert np.abs(frozen @ across).max() < 1e-12 * size


def test_only_the_pulled_direction_of_a_membrane_that_is_pushed_in_the_other_gets_stiffer():
    v = _membrane()
    u, normal = _turned(v, (1.2, 0.8), 0.4)
    (tensioned,) = _matrices(v, u, ("geometric",))
    stiffness = []
    for axis in (0, 1):
        wave = np.kron(np.sin(2.0 * np.pi * v.node_points[:, axis]), normal)
        stiffness.append(wave @ tensioned @ wave)
    # S₁ = E/(1 − ν²) (0.2 − 0.3·0.2)/1.2; the wave's gradient is 2π on each of the sides' area
    pull = 1e3 / 0.91 * 0.14 / 1.2
    assert stiffness[0] == pytest.approx(pull * 2.0 * np.pi**2, rel=0.15)  # six cells to a wave
    assert abs(stiffness[1]) < 1e-10 * stiffness[0]


@pytest.mark.parametrize("stretches", [(0.7, 0.8), (0.3, 1.0), (1e-7, 1e-7)])
def test_a_membrane_without_tension_gets_nothing(stretches):
    v = _membrane()
    u, _ = _turned(v, stretches, 0.4)
    tensioned, frozen = _matrices(v, u, ("geometric", "rotation-fixed"))
    assert np.abs(tensioned - frozen).max() < 1e-13 * np.abs(frozen).max()


def test_no_mode_is_negative_whatever_the_deformation():
    v = _membrane(3)
    rng = np.random.default_rng(1)
    for size in (0.05, 0.5, 3.0):
        u = size * rng.normal(size=v.node_points.shape) / 3.0
        (tensioned,) = _matrices(v, u, ("geometric",))
        values = np.linalg.eigvalsh(tensioned)
        assert values[0] > -1e-12 * values[-1]


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_a_stretched_membrane_that_is_plucked_comes_to_rest_in_steps_of_any_size(step):
    """Without tension in the matrix the amplitude at the longest step grows ten-thousandfold."""
    v = _membrane()
    ends = np.isin(v.mesh.points[:, 0], (0.0, 1.0))
    held = Supports.none(v).prescribe(v, ends)
    pulled = 0.2 * v.node_points * [1.0, 0.0, 0.0]
    held = held.prescribe(v, ends, pulled[held.fixed[:, 0]])
    body = DynamicBody(InternalForce(v, SKIN), side_wise_mass(v, 1.0), supports=held)
    scheme, state = RealTimeEuler(body, step), body.rest()
    state.displacement[:] = pulled
    pluck = 1e-3 * np.random.default_rng(0).normal(size=v.node_count)
    state.velocity[:, 2] = np.where(body.fixed[:, 2], 0.0, pluck)
    before = body.mass.diagonal @ state.velocity[:, 2] ** 2
    most = 0.0
    for count in range(300):
        if count == 3:
            forces = scheme.step(state)
            assert np.isfinite(forces.internal).all()
        else:
            scheme.advance(state)
        most = max(most, np.abs(state.displacement[:, 2]).max())
    # tension 183 N/m, density 1: the energy of the pluck, kept, lifts a wave by no more than this
    assert most < 10.0 * np.sqrt(before / 183.0)
    assert body.mass.diagonal @ state.velocity[:, 2] ** 2 < before


BLADE = [0.0, 0.0, 3.0]
INSIDE = ToolPath.of_tip([[0.15, 0.43, -1.0], [0.85, 0.55, -1.0]], [0.0, 1.0], BLADE)
THROUGH = ToolPath.of_tip([[-0.2, 0.43, -1.0], [1.2, 0.55, -1.0]], [0.0, 1.0], BLADE)
ACROSS = ToolPath.of_tip([[0.52, -0.2, -1.0], [0.47, 1.2, -1.0]], [2.0, 3.0], BLADE)


def curved(count=6, diagonal="alternating"):
    flat = rectangle_mesh((count, count), diagonal=diagonal)
    x, y = flat.points.T
    return SimplexMesh(np.stack([x, y, 0.3 * np.sin(2.0 * x) * np.cos(y)], axis=1), flat.cells)


def stroked(mesh, *paths, frames=5):
    """Cutter and surface after strokes, taken frame by frame."""
    cutter = SemiProgressiveCutter(mesh)
    skin = BodySurface(cutter.body)
    for path in paths:
        cutter.begin(path)
        for time in np.linspace(path.times[0], path.times[-1], frames):
            skin.update(cutter.advance(time))
    return cutter, skin


def area_and_normals(skin):
    corners = skin.surface.material.rows[skin.surface.facets.rows[skin.surface.used]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0
    return np.linalg.norm(normals, axis=1).sum(), normals


def used_once(skin):
    """Directed edges of one facet only."""
    facets = skin.surface.facets.rows[skin.surface.used]
    edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]).tolist()
    return {tuple(edge) for edge in edges} - {tuple(edge[::-1]) for edge in edges}


def rims_of(skin):
    """Those of them (k, 2) that do not lie on the border of the unit square."""
    once = np.array(sorted(used_once(skin)))
    ends = skin.surface.material.rows[once][:, :, :2]
    on_border = (((ends == 0.0) | (ends == 1.0)) & (ends[:, :1] == ends[:, 1:])).all(axis=1)
    return once[~on_border.any(axis=1)]


def loops(edges):
    """Number of closed loops that directed edges make; each vertex must be left once."""
    follow = dict(edges.tolist())
    assert len(follow) == len(edges) == len(set(follow.values()))
    count = 0
    while follow:
        start, _ = next(iter(follow.items()))
        at = start
        while True:
            at = follow.pop(at)
            if at == start:
                break
        count += 1
    return count


@pytest.mark.parametrize("diagonal", ["right", "alternating", "crossed"])
def test_a_cut_gives_a_membrane_two_rims_of_its_length_and_no_inner_surface(diagonal) -> None:
    cutter, skin = stroked(curved(7, diagonal), INSIDE)
    area, normals = area_and_normals(skin)
    assert area == pytest.approx(cutter.mesh.measures.sum(), rel=1e-14)
    assert (normals[:, 2] > 0.0).all()  # every part keeps the direction of the membrane
    assert not skin.surface.inner.rows[skin.surface.used].any()
    rims = rims_of(skin)
    # one slit: both rims together are one closed loop around it
    assert loops(rims) == 1
    along = skin.surface.material.rows[rims]
    steps = along[:, 1] - along[:, 0]
    assert np.abs(steps.sum(axis=0)).max() < 1e-13
    forward = steps @ np.array([0.7, 0.12, 0.0]) > 0.0
    lengths = np.linalg.norm(steps, axis=1)
    assert lengths[forward].sum() == pytest.approx(lengths[~forward].sum(), rel=1e-12)
    assert lengths[forward].sum() > 0.4
    # no edge hangs: every edge is used twice, or once at an edge of the membrane or at a rim
    once = used_once(skin)
    outer = once - {tuple(edge) for edge in rims.tolist()}
    assert len(outer) == len(cutter.mesh.boundary_facets)


def test_two_strokes_through_a_membrane_leave_four_parts_with_rims_of_their_own() -> None:
    _, skin = stroked(curved(), THROUGH, ACROSS)
    once = used_once(skin)
    assert loops(np.array(sorted(once))) == 4
    assert len(rims_of(skin)) > 0


def test_the_rims_open_with_the_material_and_forces_on_them_do_the_same_work() -> None:
    cutter, skin = stroked(curved(), THROUGH)
    phantom = cutter.phantom_mesh()
    apart = np.where(phantom.node_side[:, :1] > 0, 1.0, -1.0) * [0.0, 0.1, 0.02]
    x = skin.surface.positions(apart)
    rims = rims_of(skin)
    moved = (x - skin.surface.material.rows)[rims.ravel()]
    assert np.allclose(np.abs(moved), [0.0, 0.1, 0.02], atol=1e-14)
    assert 0 < (moved[:, 1] > 0.0).sum() < len(moved)
    random = np.random.default_rng(3)
    rows = skin.surface.used
    at, force = random.dirichlet(np.ones(3), len(rows)), random.normal(size=(len(rows), 3))
    nodal, u = np.zeros_like(apart), random.normal(size=apart.shape)
    skin.surface.add_forces(rows, at, force, nodal)
    steps = (skin.surface.positions(u) - skin.surface.material.rows)[skin.surface.facets.rows[rows]]
    work = np.sum(force * np.einsum("qk,qks->qs", at, steps))
    assert np.sum(nodal * u) == pytest.approx(work, rel=1e-12)
