"""Random and degenerate strokes: sound bodies, whatever the order and the numbering."""

import numpy as np
import pytest
from cut_comparison import assert_same_cut
from degenerate_strokes import body
from degenerate_strokes import strokes as degenerate_strokes
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from random_strokes import meshes, strokes
from surface_measures import enclosed_by_body, loose_edges, volume_by_body

from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import PhantomMesh, cut_mesh

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
# tie, but for the order of the sum (4086); a centroid on a cut, but for round-off (8150)
IN_THE_PLANE = (147, 196, 1130, 1823, 2124, 4086)
IN_SPACE = (
    103, 308, 394, 497, 2013, 2236, 3025, 3107, 5136, 8150, 9125, 20073, 20428, 20869, 21414,
)  # fmt: skip
FAILED_ONCE = [(2, seed) for seed in IN_THE_PLANE] + [(3, seed) for seed in IN_SPACE]


@pytest.mark.parametrize(("dim", "seed"), FAILED_ONCE)
def test_what_once_failed_does_not(dim, seed) -> None:
    assert cut_one_body(dim, seed) > 0


@pytest.mark.parametrize("dim", [2, 3])
def test_degenerate_cuts_leave_a_sound_body(dim) -> None:
    assert sum(cut_one_body(dim, seed) for seed in range(20)) > 40


@pytest.mark.heavy
@pytest.mark.parametrize("block", range(10))
@pytest.mark.parametrize("dim", [2, 3])
def test_ten_thousand_degenerate_cuts_leave_sound_bodies(dim, block) -> None:
    seeds = range(1000 * block, 1000 * block + 1000)
    insertions = 0
    for seed in seeds:
        insertions += cut_one_body(dim, seed)
        if insertions >= 500:
            return
    pytest.fail(f"only {insertions} insertions")


# Of random sets of two to four strokes that are exactly degenerate or nearly, a third of which end
# inside the body, with tip rule `inside`: shares that docs/theory/xfem.md states, rounded up.
ORDER, NUMBERING = {2: 0.004, 3: 0.015}, {2: 0.002, 3: 0.006}


def _same(a: PhantomMesh, b: PhantomMesh, order) -> bool:
    """Whether pieces, their volumes and common unknowns are the same.

    The cuts of `b` are those of `a` in another order.
    """
    sides = [a.piece_side, b.piece_side[:, np.argsort(order)]]
    parents, fractions, cells = (
        [getattr(v, name) for v in (a, b)] for name in ("parent", "fraction", "cells")
    )
    if len(cells[0]) != len(cells[1]):
        return False
    first, second = (np.lexsort([*s.T, p]) for s, p in zip(sides, parents, strict=True))
    if not (
        np.array_equal(parents[0][first], parents[1][second])
        and np.array_equal(sides[0][first], sides[1][second])
        and np.allclose(fractions[0][first], fractions[1][second], rtol=0.0, atol=1e-9)
    ):
        return False
    pairs = np.unique(np.stack([cells[0][first].ravel(), cells[1][second].ravel()]), axis=1)
    return all(len(np.unique(column)) == pairs.shape[1] for column in pairs)


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
        differs += not _same(cut_mesh(mesh, cuts), after, order)
    return differs / len(seeds)


def test_order_and_numbering_matter_in_few_of_a_hundred_sets_of_degenerate_cuts():
    # twice the frequency, and one set more: the sample is small
    assert _share_that_differs(2, range(100), renumber=False) <= 2 * ORDER[2] + 0.01
    assert _share_that_differs(2, range(100), renumber=True) <= 2 * NUMBERING[2] + 0.01


@pytest.mark.heavy
@pytest.mark.parametrize("dim", [2, 3])
def test_order_and_numbering_matter_as_rarely_as_the_guide_says(dim):
    assert _share_that_differs(dim, range(2000), renumber=False) <= ORDER[dim]
    assert _share_that_differs(dim, range(2000), renumber=True) <= NUMBERING[dim]


QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],  # shrinking takes minutes; the heavy run shrinks
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
THOROUGH = settings(
    max_examples=3000,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)

# a move so short that its square is zero
HARDLY_MOVES = ToolPath.of_tip([[0.0, 0.0], [0.0, 7.90408581e-297], [0.0, 1.0]], [0.0, 1.0, 2.0])
# a blade that moves along itself, up to 1e-13 of its length
ALONG = [[-0.1, 0.0, 0.0], [0.5, 0.0, 0.0]]
SWEEPS_NOTHING = ToolPath.of_tip(ALONG, [0.0, 1.0], [-0.1, 1e-13, 0.0])
STROKES_THAT_FAILED_ONCE = {
    2: (rectangle_mesh([1, 1]), [HARDLY_MOVES], []),
    3: (box_mesh([1, 1, 1]), [SWEEPS_NOTHING], []),
}


def _claims(dim: int, most: int):
    @example(*STROKES_THAT_FAILED_ONCE[dim])
    @given(meshes(dim), strokes(dim, most), st.lists(st.floats(0.0, 3.0), max_size=3))
    def claim(mesh, paths, moments):
        cutter = SemiProgressiveCutter(mesh)
        surface = BodySurface(cutter.body)
        for path in paths:
            cutter.begin(path)
            for time in [*(path.times[0] + m for m in sorted(moments)), path.times[-1]]:
                surface.update(cutter.advance(time))
            phantom = cutter.phantom_mesh()
            if cutter.body.held == 0:  # else the cuts at once would join what was separate
                assert_same_cut(
                    phantom, cut_mesh(mesh, [p.sweep for p in paths[: len(cutter.strokes)]])
                )
            assert (phantom.fraction > 0.0).all()
            np.testing.assert_allclose(phantom.volumes.sum(), 1.0, rtol=1e-13)
            facets = surface.surface.facets.rows[surface.surface.used]
            assert loose_edges(facets) == 0
            # the sum of some thousand triangles' shares, each of round-off 1e-16
            np.testing.assert_allclose(
                enclosed_by_body(surface.surface, phantom), volume_by_body(phantom), atol=1e-12
            )

    return claim


@pytest.mark.parametrize(("dim", "most"), [(2, 4), (3, 3)])
def test_random_strokes_leave_sound_bodies(dim, most) -> None:
    QUICK(_claims(dim, most))()


@pytest.mark.heavy
@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_random_strokes(dim) -> None:
    THOROUGH(_claims(dim, 4))()
