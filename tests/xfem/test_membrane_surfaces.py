"""Cut membranes: their surface with two rims, contact with it, and tools pulled back to it."""

import numpy as np
import pytest

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import rectangle_mesh

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
    rims = skin.rims
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
    facets = skin.surface.facets.rows[skin.surface.used]
    edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    once = {tuple(edge) for edge in edges.tolist()} - {tuple(edge[::-1]) for edge in edges.tolist()}
    outer = once - {tuple(edge) for edge in rims.tolist()}
    assert len(outer) == len(cutter.mesh.boundary_facets)


def test_two_strokes_through_a_membrane_leave_four_parts_with_rims_of_their_own() -> None:
    _, skin = stroked(curved(), THROUGH, ACROSS)
    facets = skin.surface.facets.rows[skin.surface.used]
    edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    once = {tuple(edge) for edge in edges.tolist()} - {tuple(edge[::-1]) for edge in edges.tolist()}
    assert loops(np.array(sorted(once))) == 4
    assert len(skin.rims) > 0


def test_the_rims_open_with_the_material_and_forces_on_them_do_the_same_work() -> None:
    cutter, skin = stroked(curved(), THROUGH)
    phantom = cutter.phantom_mesh()
    apart = np.where(phantom.node_side[:, :1] > 0, 1.0, -1.0) * [0.0, 0.1, 0.02]
    x = skin.surface.positions(apart)
    rims = skin.rims
    moved = (x - skin.surface.material.rows)[rims.ravel()]
    assert np.allclose(np.abs(moved), [0.0, 0.1, 0.02], atol=1e-14)
    assert 0 < (moved[:, 1] > 0.0).sum() < len(moved)
    random = np.random.default_rng(3)
    force = random.normal(size=x.shape)
    nodal = np.zeros_like(apart)
    skin.surface.nodal_forces(force, nodal)
    u = random.normal(size=apart.shape)
    work = np.sum(force * (skin.surface.positions(u) - skin.surface.material.rows))
    assert np.sum(nodal * u) == pytest.approx(work, rel=1e-12)
