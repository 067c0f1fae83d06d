"""The rule `extended`: which elements it divides past the end of a cut, and which it leaves."""

import numpy as np
import pytest

import verify.xfem as xfem
from verify.xfem.cuts import PolygonPatch


def moved_box(d, seed, n=6):
    """A unit square or cube whose inner nodes are moved at random."""
    mesh = (xfem.rectangle_mesh if d == 2 else xfem.box_mesh)((n,) * d)
    inner = np.all((mesh.points > 0.0) & (mesh.points < 1.0), axis=1)
    moves = np.random.default_rng(seed).uniform(-0.2, 0.2, mesh.points.shape) / n
    return xfem.SimplexMesh(mesh.points + moves * inner[:, None], mesh.cells)


def plane_to(x, d, height=0.437, slope=0.13):
    """A cut from the left side up to x, inclined."""
    low, high = height - 2.0 * slope, height + slope * x
    if d == 2:
        return xfem.Polyline([[-2.0, low], [x, high]])
    return PolygonPatch([[-2.0, low, -1], [x, high, -1], [x, high, 2], [-2.0, low, 2]])


def divided(mesh, cuts, tip, cut=0):
    """Cells (m,) that a cut divides."""
    phantom = xfem.cut_mesh(mesh, cuts, tip)
    found = np.zeros(len(mesh.cells), dtype=bool)
    found[phantom.parent[phantom.label[:, cut] != 0]] = True
    return found


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_far_from_all_else_it_is_through(d, seed):
    """In space the front goes through the sides, whose facets it meets itself."""
    mesh, cuts = moved_box(d, seed), [plane_to(0.52, d)]
    whole, extended, through = (
        divided(mesh, cuts, tip) for tip in ("inside", "extended", "through")
    )
    assert np.array_equal(extended, through)
    assert whole.sum() < extended.sum()
    assert extended[whole].all()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("before", [0.05, 0.3])
def test_a_body_that_the_cut_leaves_whole_stays_whole(d, before):
    """However near the end is to the side, in elements; `through` parts the body."""
    parted = []
    for seed in range(4):
        mesh = moved_box(d, seed)
        cuts = [plane_to(1.0 - before / 6, d)]
        for tip in ("extended", "through"):
            bodies = xfem.cut_mesh(mesh, cuts, tip).bodies
            parted.append((tip, len(set(bodies.tolist()))))
    assert {count for tip, count in parted if tip == "extended"} == {1}
    assert max(count for tip, count in parted if tip == "through") == 2


@pytest.mark.parametrize("d", [2, 3])
def test_an_end_on_a_line_of_the_mesh_is_not_extended(d):
    """It has gone through the element before it, and not into the one behind it."""
    mesh = (xfem.rectangle_mesh if d == 2 else xfem.box_mesh)((4,) * d)
    cuts = [plane_to(0.5, d, slope=0.0)]
    assert np.array_equal(divided(mesh, cuts, "extended"), divided(mesh, cuts, "inside"))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_an_element_that_another_cut_meets_is_left_to_the_rule_inside(d, seed):
    """A cut that ends just before another one does not join it; elsewhere it is extended."""
    mesh = moved_box(d, seed)
    wall = [[0.61, -1.0], [0.57, 2.0]]
    if d == 2:
        other = xfem.Polyline(wall)
    else:
        (x, low), (top, high) = wall
        other = PolygonPatch([[x, low, -1], [x, low, 2], [top, high, 2], [top, high, -1]])
    cuts = [plane_to(0.55, d), other]
    both = divided(mesh, cuts, "extended", 1)
    assert np.array_equal(both, divided(mesh, cuts, "inside", 1))
    found, whole = (divided(mesh, cuts, tip) for tip in ("extended", "inside"))
    assert np.array_equal(found[both], whole[both])
    assert len(set(xfem.cut_mesh(mesh, cuts, "extended").bodies.tolist())) == 2


def test_it_divides_the_same_elements_whatever_the_axes_and_the_numbers_of_nodes():
    """Two cuts to a depth of 0.6 that end near the outline: edges of cells ahead are bisected."""
    random = np.random.default_rng(0)
    for seed in range(14):
        mesh = moved_box(3, seed, 3)
        ends = random.uniform([0.6, 0.3], [0.95, 0.6], (2, 2))
        slopes = random.uniform(-0.2, 0.2, 2)
        found = []
        for axes in (np.eye(3), np.eye(3), np.diag([-1.0, 1.0, 1.0])):
            order = random.permutation(len(mesh.points))
            cells = random.permuted(np.argsort(order)[mesh.cells], axis=1)
            cuts = []
            for k, ((x, height), slope) in enumerate(zip(ends, slopes, strict=True)):
                corners = plane_to(x, 3, height, slope).corners.copy()
                corners[2:, 2] = 0.6
                cuts.append(PolygonPatch(np.roll(corners, k, axis=1) @ axes))
            moved = xfem.SimplexMesh((mesh.points @ axes)[order], cells)
            found.append([divided(moved, cuts, "extended", k) for k in range(2)])
        assert np.array_equal(found[0], found[1])
        assert np.array_equal(found[0], found[2])
