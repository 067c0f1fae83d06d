"""Random and degenerate strokes: sound bodies, whatever the order and the numbering."""

import numpy as np
import pytest
from cut_comparison import assert_same_cut, same_cut
from degenerate_strokes import body
from degenerate_strokes import strokes as degenerate_strokes
from surface_measures import enclosed_by_body, loose_edges, volume_by_body

from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

STROKES = 4  # a body; each one meets what those before have left


def assert_sound(cutter: SemiProgressiveCutter, skin: BodySurface) -> None:
    """Volumes, sub-simplices and surface of a body that has been cut."""
    phantom = cutter.phantom_mesh()
    mesh, sub = phantom.mesh, phantom.sub_cells
    assert (phantom.fraction > 0.0).all()
    assert (sub.fraction > 0.0).all()
    # every share is a sum of a few products of a few ratios, each good to a few ulp
    in_cell = np.bincount(phantom.parent, phantom.fraction, minlength=len(mesh.cells))
    np.testing.assert_allclose(in_cell, 1.0, rtol=1e-14)
    assert phantom.volumes.sum() == pytest.approx(mesh.measures.sum(), rel=1e-14)
    of_piece = np.bincount(sub.piece, sub.fraction, minlength=len(phantom.cells))
    np.testing.assert_allclose(of_piece[phantom.split], phantom.fraction[phantom.split], 1e-14)
    assert len(np.unique(phantom.cells)) == phantom.node_count  # no unknown without material
    surface = skin.surface
    assert loose_edges(surface.facets.rows[surface.used]) == 0
    # vertices are rounded to 1 ulp of the body's size, and the sum over hundreds of facets is not
    # relative to the piece: absolute, in units of the unit body
    np.testing.assert_allclose(
        enclosed_by_body(surface, phantom), volume_by_body(phantom), rtol=0.0, atol=1e-13
    )


def cut_one_body(dim: int, seed: int) -> int:
    """Cut a body stroke by stroke; the number of insertions that changed it."""
    rng = np.random.default_rng([dim, seed])
    cutter = SemiProgressiveCutter(body(rng, dim))
    skin = BodySurface(cutter.body)
    insertions = 0
    for path in degenerate_strokes(rng, cutter.mesh, STROKES):
        cutter.begin(path)
        # every other stroke in several frames: what is cut grows
        for time in np.linspace(*path.times[[0, -1]], rng.choice([2, 2, 5]))[1:]:
            increment = cutter.advance(time)
            if increment is None:
                continue
            insertions += 1
            skin.update(increment)
            assert_sound(cutter, skin)
    if cutter.body.held == 0:
        assert_same_cut(cutter.phantom_mesh(), cut_mesh(cutter.mesh, cutter.cuts))
    return insertions


# seeds that once failed: a vertex 1e-9 off a line was taken for one on it, and facets were bisected
# for ever; a weight rounded to zero; an edge from a vertex on one cut to a point of the same cut
# was not known to lie on it; a cell crossed only within round-off was never asked again; no facet
# left to be made; faces of elements that are free in part only (2013, 2236, 5136); a point on an
# edge within a face that no cut follows (9125); points on a line ordered along the difference of
# two that are 1e-28 apart, and the surface 1/288 off (3107); a piece
# that had no volume, and was left out, had 3e-44 of its cell when it was divided further (20428);
# a cell with a piece left out beside one that got new unknowns (103); a piece left to the half of
# its neighbour that a later cut had separated from it (in the plane: 196); facets on the two sides
# of a face that differ, with a piece of round-off size gone to another (1130, 3025); a whole cell
# beside one whose piece had taken another (2124); a vote on the side of an unknown that ends in a
# tie, but for the order of the sum (4086); a centroid on a cut, but for round-off (8150); a piece
# that took what was left of a neighbour, 6e-24 of the cell, and had the share of before (1909)
FAILED_ONCE = {
    2: (147, 196, 1130, 1823, 2124, 4086),
    3: (103, 308, 394, 497, 1909, 2013, 2236, 3025, 3107, 5136, 8150, 9125, 20073, 20428, 20869,
        21414),
}  # fmt: skip


@pytest.mark.parametrize("dim", [2, 3])
def test_degenerate_cuts_that_once_failed_leave_a_sound_body(dim) -> None:
    for seed in FAILED_ONCE[dim]:
        assert cut_one_body(dim, seed) > 0, seed


@pytest.mark.heavy
@pytest.mark.parametrize("first", range(0, 2000, 250))
@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_degenerate_cuts_leave_sound_bodies(dim, first) -> None:
    assert sum(cut_one_body(dim, seed) for seed in range(first, first + 250)) > 500


def test_a_blade_that_hardly_moves_or_moves_along_itself_leaves_a_sound_body() -> None:
    """By less than the root of the least number; and along itself up to 1e-13 of its length."""
    moves = ToolPath.of_tip([[0.0, 0.0], [0.0, 7.90408581e-297], [0.0, 1.0]], [0.0, 1.0, 2.0])
    along = [[-0.1, 0.0, 0.0], [0.5, 0.0, 0.0]]
    slides = ToolPath.of_tip(along, [0.0, 1.0], [-0.1, 1e-13, 0.0])
    for mesh, path in ((rectangle_mesh([1, 1]), moves), (box_mesh([1, 1, 1]), slides)):
        cutter = SemiProgressiveCutter(mesh)
        skin = BodySurface(cutter.body)
        cutter.begin(path)
        skin.update(cutter.advance(path.times[-1]))
        assert_sound(cutter, skin)
        assert_same_cut(cutter.phantom_mesh(), cut_mesh(mesh, [path.sweep]))


# Of random sets of two to four strokes that are exactly degenerate or nearly, a third of which end
# inside the body, with tip rule `inside`: shares that docs/theory/xfem.md states, rounded up.
ORDER, NUMBERING = {2: 0.004, 3: 0.015}, {2: 0.002, 3: 0.006}


def _share_that_differs(dim, seeds, renumber):
    differs = 0
    for seed in seeds:
        rng = np.random.default_rng([dim, seed])
        mesh = body(rng, dim)
        cuts = [path.sweep for path in degenerate_strokes(rng, mesh, int(rng.integers(2, 5)))]
        order = np.arange(len(cuts))
        if renumber:
            new = rng.permutation(len(mesh.points))
            other = SimplexMesh(mesh.points[np.argsort(new)], new[mesh.cells])
        else:
            order, other = np.roll(order, 1 + seed % (len(cuts) - 1)), mesh
        after = cut_mesh(other, [cuts[k] for k in order])
        differs += not same_cut(cut_mesh(mesh, cuts), after, order, 1e-9)
    return differs / len(seeds)


@pytest.mark.parametrize(
    ("dim", "count"),
    [(2, 50), *(pytest.param(dim, 2000, marks=pytest.mark.heavy) for dim in (2, 3))],
)
def test_order_and_numbering_matter_as_rarely_as_the_guide_says(dim, count):
    # a small sample: one set more
    more = 1 / count if count < 100 else 0.0
    assert _share_that_differs(dim, range(count), renumber=False) <= ORDER[dim] + more
    assert _share_that_differs(dim, range(count), renumber=True) <= NUMBERING[dim] + more
