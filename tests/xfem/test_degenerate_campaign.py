"""Ten thousand cuts that are degenerate or within 1e-1 … 1e-14 of it, each checked at once.

Whatever a user cuts, after every insertion: no volume is lost or negative, no piece is lost, and
the surface of the material closes around every free body.
"""

import numpy as np
import pytest
from cut_comparison import assert_same_cut
from degenerate_strokes import body, strokes
from surface_measures import enclosed_by_body, loose_edges, volume_by_body

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
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
    for path in strokes(rng, cutter.mesh, STROKES):
        cutter.begin(path)
        # every other stroke in several frames: what is cut grows
        for time in np.linspace(*path.times[[0, -1]], rng.choice([2, 2, 5]))[1:]:
            increment = cutter.advance(time)
            if increment is None:
                continue
            insertions += 1
            skin.update(increment)
            assert_sound(cutter, skin)
    if cutter.body.held == 0 and cutter.body.vanished == 0:
        assert_same_cut(cutter.phantom_mesh(), cut_mesh(cutter.mesh, cutter.cuts))
    return insertions


# seeds that once failed: a vertex 1e-9 off a line was taken for one on it, and facets were bisected
# for ever; a weight rounded to zero; an edge from a vertex on one cut to a point of the same cut
# was not known to lie on it; a cell crossed only within round-off was never asked again; no facet
# left to be made; faces of elements that are free in part only (2013, 2236, 5136); a point on an
# edge within a face that no cut follows (9125); points on a line ordered along the difference of
# two that are 1e-28 apart, and the surface 1/288 off (3107); a piece
# that had no volume, and was left out, had 3e-44 of its cell when it was divided further (20428)
FAILED_IN_SPACE = (308, 394, 497, 2013, 2236, 3107, 5136, 9125, 20073, 20428, 20869, 21414)
FAILED_ONCE = [(2, 147), (2, 1823)] + [(3, seed) for seed in FAILED_IN_SPACE]


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
