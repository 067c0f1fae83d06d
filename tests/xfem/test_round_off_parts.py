"""Parts of round-off size: cuts that nearly meet vertices, edges and one another."""

import numpy as np
import pytest
from cut_comparison import same_cut
from degenerate_strokes import NEARNESS, body
from xfem_bodies import boundary_nodes, zero_modes

import verify.xfem as xfem
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.arrays import SingularStiffnessError
from verify.xfem.clip import ROUND_OFF_SHARE
from verify.xfem.cuts import ToolPath
from verify.xfem.loads_and_supports import UnsupportedBodyError

RIGID = {2: 3, 3: 6}
FAR = 3.0  # half the length of a stroke that goes through the unit body


def _place(rng, mesh, earlier):
    """Point and normal of the next cut, and whether it ends at that point."""
    dim = mesh.space
    near = float(rng.choice(NEARNESS)) * rng.choice([-1.0, 1.0])
    normal = rng.normal(size=dim)
    normal /= np.linalg.norm(normal)
    kind = rng.choice(["vertex", "edge", "crossing", "branch", "anywhere"])
    if kind == "vertex":
        return mesh.points[rng.integers(len(mesh.points))] + near * normal, normal, None
    if kind == "edge":
        corners = mesh.points[mesh.cells[rng.integers(len(mesh.cells))]]
        edge = corners[1] - corners[0]
        normal -= (normal @ edge) / (edge @ edge) * edge
        normal /= np.linalg.norm(normal)
        return corners[0] + near * normal, normal, None
    if kind == "crossing" and len(earlier) >= 2:
        points, normals = map(
            np.array, zip(*[earlier[k] for k in rng.choice(len(earlier), 2, False)], strict=True)
        )
        middle = points.mean(axis=0)
        to_both = np.linalg.pinv(normals) @ ((points - middle) * normals).sum(axis=1)
        return middle + to_both + near * normal, normal, None
    point = rng.uniform(0.15, 0.85, dim)
    if kind == "branch" and earlier:
        at, stem = earlier[rng.integers(len(earlier))]
        return point - ((point - at) @ stem) * stem, normal, near
    return point, normal, None


def nearly_meeting_strokes(rng, mesh, count) -> list[ToolPath]:
    """Straight strokes past vertices, along edges, past the crossing of two others, off another."""
    earlier, paths = [], []
    while len(paths) < count:
        point, normal, end = _place(rng, mesh, earlier)
        if ((point < -0.1) | (point > 1.1)).any():
            continue
        if mesh.space == 2:
            along, depth = np.array([normal[1], -normal[0]]), None
        else:
            along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
            along /= np.linalg.norm(along)
            deep = np.cross(normal, along)
            point, depth = point - FAR * deep, 2.0 * FAR * deep
        tips = np.stack([point - (FAR if end is None else end) * along, point + FAR * along])
        times = 10.0 * len(paths) + np.arange(2)
        try:
            paths.append(ToolPath.of_tip(tips[:: rng.choice([1, -1])], times, depth))
        except xfem.XfemError:
            continue
        earlier.append((point, normal))
    return paths


def patch_error(phantom):
    """Error of an infinitesimal rotation of the body, prescribed where it ends; 0 if it is loose.

    It is affine and free of stress, so that the faces of cuts are free in it.
    """
    dim, nodes = phantom.mesh.dim, boundary_nodes(phantom.mesh)
    gradient = np.triu(np.arange(1.0, dim * dim + 1.0).reshape(dim, dim), 1) / dim**2
    gradient -= gradient.T
    supports = xfem.Supports.none(phantom).prescribe(phantom, nodes, lambda x, _: x @ gradient.T)
    material = xfem.isotropic(1.0, 0.3, "plane strain" if dim == 2 else "solid")
    try:
        found = xfem.solve_static(phantom, material, supports).displacement
    except UnsupportedBodyError:
        return 0.0
    except SingularStiffnessError:  # a mechanism
        return np.inf
    return np.abs(found - phantom.node_points @ gradient.T).max()


def surprises(dim, seeds):
    """Seeds of bodies with other zero modes than rigid ones, and with a wrong patch test; and the
    least share of a piece in its cell.

    Where supports hold a body by a piece of share w only, round-off of its other stiffness is to
    that of the hold as 2⁻⁵² to w: so many digits are lost, and no more.
    """
    modes, patches, least = [], [], 1.0
    for seed in seeds:
        rng = np.random.default_rng([29, dim, seed])
        mesh = body(rng, dim)
        paths = nearly_meeting_strokes(rng, mesh, int(rng.integers(2, 5)))
        phantom = xfem.cut_mesh(mesh, [path.sweep for path in paths])
        least = min(least, phantom.fraction.min())
        assert phantom.volumes.sum() == pytest.approx(mesh.measures.sum(), rel=1e-14)
        if zero_modes(phantom)[0] != RIGID[dim] * (phantom.bodies.max() + 1):
            modes.append(seed)
        if patch_error(phantom) > max(1e-8, ROUND_OFF_SHARE / phantom.fraction.min()):
            patches.append(seed)
        cutter = SemiProgressiveCutter(mesh)
        for path in paths:
            cutter.begin(path)
            for time in np.linspace(*path.times, rng.choice([2, 5]))[1:]:
                cutter.advance(time)
        assert same_cut(cutter.phantom_mesh(), phantom, atol=1e-12), seed
    return modes, patches, least


# 20 of 1 950 random bodies had mechanisms, and 10 of 3 364 failed the patch test, while pieces down
# to 1e-42 of a cell had unknowns of their own: what such pieces alone held together was a hinge
HEAVY = [pytest.param(*much, marks=pytest.mark.heavy) for much in ((2, 1600), (3, 450))]


@pytest.mark.parametrize(("dim", "bodies"), [(2, 25), (3, 6), *HEAVY])
def test_cuts_that_nearly_meet_leave_no_mechanism_and_the_same_body_step_by_step(dim, bodies):
    modes, patches, least = surprises(dim, range(bodies))
    assert (modes, patches) == ([], [])
    assert ROUND_OFF_SHARE < least < 1e-9


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("near", [1e-7, 1e-13])
def test_a_layer_beside_a_layer_of_nodes_is_held_together_or_left_to_its_neighbours(dim, near):
    """Beside faces it keeps its thickness; beside edges it has near² or less of a cell."""
    mesh = xfem.rectangle_mesh((2, 2)) if dim == 2 else xfem.box_mesh((2, 2, 2))
    normal = np.eye(dim)[-1]
    cuts = [xfem.Plane(0.5 * normal, normal), xfem.Plane((0.5 + near) * normal, normal)]
    phantom = xfem.cut_mesh(mesh, cuts)
    assert zero_modes(phantom)[0] == RIGID[dim] * (phantom.bodies.max() + 1)
    volumes = np.bincount(phantom.bodies[phantom.cells[:, 0]], phantom.volumes)
    thin = np.sort(volumes)[:-2].sum()
    absorbed = phantom.dropped * ROUND_OFF_SHARE * mesh.measures.max()
    # positions carry 2e-16
    assert abs(thin - near) <= absorbed + 4e-16
