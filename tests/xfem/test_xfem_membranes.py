"""Membranes: stiffness, patch test, tension, hanging under weight, rims of their cuts."""

import numpy as np
import pytest
from cut_bodies import rotation
from xfem_bodies import boundary_nodes

from verify.accelerated import FAST
from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane, ToolPath
from verify.xfem.element import isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.statics import NotInEquilibriumError, solve_static

MATERIAL = isotropic(1e4, 0.3, "plane stress")


def test_each_half_of_a_cut_membrane_passes_the_patch_test_in_its_plane():
    """Constant strain along the cut, another one per half, free contraction across."""
    flat, place = rectangle_mesh((6, 5)), np.array([0.5, 0.53, 0.0])
    along, across = (np.array(way) / np.hypot(1.0, 0.3) for way in ([1.0, 0.3, 0], [-0.3, 1.0, 0]))
    points = np.pad(flat.points, ((0, 0), (0, 1)))
    membrane = cut_mesh(SimplexMesh(points, flat.cells), [Plane(place, across)])

    def stretched(x, side):
        strain = np.where(side[:, 0] > 0, 0.1, -0.05)
        u, v = strain * ((x - place) @ along), -0.3 * strain * ((x - place) @ across)
        return u[:, None] * along + v[:, None] * across

    supports = Supports.none(membrane).prescribe(membrane, boundary_nodes(membrane.mesh), stretched)
    everywhere = np.ones(len(points), dtype=bool)
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


def hang(phantom, poisson, held, load_steps=1, weight=WEIGHT, kernels=PLAIN):
    force = InternalForce(phantom, isotropic(STIFFNESS, poisson, "plane stress"), kernels=kernels)
    load = side_wise_mass(phantom, weight / 9.8).weight([0.0, 0.0, -9.8])
    return static_equilibrium(force, np.repeat(held[:, None], 3, axis=1), None, load, load_steps)


def test_a_cut_bowl_finds_its_equilibrium_in_one_load_step():
    """Parts of it are slack on their way: halving the residual ended at 7 % of the forces."""
    bowl, held = cut_bowl(12)
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
    given = {"weight": 10.0 * WEIGHT, "kernels": FAST}
    assert hang(bowl, 0.2, held, **given).iterations[0] < 16
    with pytest.raises(NotInEquilibriumError, match="1 of 1199 pieces have collapsed"):
        hang(bowl, 0.3, held, **given)


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


def test_across_the_plane_of_a_stretched_membrane_the_stiffness_is_the_exact_one():
    v = _membrane()
    u, normal = _turned(v, (1.2, 1.05), 1.1)
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


def test_a_membrane_without_tension_gets_nothing_and_no_mode_is_ever_negative():
    v, rng = _membrane(3), np.random.default_rng(1)
    for stretches in ((0.7, 0.8), (0.3, 1.0), (1e-7, 1e-7)):
        u, _ = _turned(v, stretches, 0.4)
        tensioned, frozen = _matrices(v, u, ("geometric", "rotation-fixed"))
        assert np.abs(tensioned - frozen).max() < 1e-13 * np.abs(frozen).max()
    for size in (0.05, 0.5, 3.0):
        (tensioned,) = _matrices(v, size * rng.normal(size=u.shape) / 3.0, ("geometric",))
        values = np.linalg.eigvalsh(tensioned)
        assert values[0] > -1e-12 * values[-1]


@pytest.mark.parametrize("step", [1e-2, 0.1])
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
    for count in range(150):
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


def curved():
    flat = rectangle_mesh((6, 6), diagonal="alternating")
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


def test_a_cut_gives_a_membrane_two_rims_of_its_length_and_no_inner_surface() -> None:
    cutter, skin = stroked(curved(), INSIDE)
    area, normals = area_and_normals(skin)
    assert area == pytest.approx(cutter.mesh.measures.sum(), rel=1e-14)
    assert (normals[:, 2] > 0.0).all()  # every part keeps the direction of the membrane
    assert not skin.surface.inner.rows[skin.surface.used].any()
    rims = rims_of(skin)
    # one slit: both rims together are closed around it, each vertex left once and reached once
    assert set(rims[:, 0]) == set(rims[:, 1])
    assert len(set(rims[:, 0])) == len(rims)
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
