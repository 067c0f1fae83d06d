"""Random strokes, generic and degenerate: the growing body never departs from the cut at once.

Checked after every stroke: same pieces and joins as `cut_mesh`; volumes sum to the body's; the
surface of the material closes, is oriented, and encloses the volume of each free body. The one
exception is counted (`GrowingBody.held`): a later stroke may leave an earlier one, cut at once,
ending inside an element that it had already split.
"""

import numpy as np
import pytest
from cut_comparison import assert_same_cut
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from random_strokes import meshes, strokes
from surface_measures import enclosed_by_body, loose_edges, volume_by_body

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
from verify.xfem.cuts import ToolPath
from verify.xfem.phantom import cut_mesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh

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
FAILED_ONCE = {
    2: (rectangle_mesh([1, 1]), [HARDLY_MOVES], []),
    3: (box_mesh([1, 1, 1]), [SWEEPS_NOTHING], []),
}


def _claims(dim: int, most: int):
    @example(*FAILED_ONCE[dim])
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


def test_random_strokes_in_the_plane() -> None:
    QUICK(_claims(2, 4))()


def test_random_strokes_in_space() -> None:
    QUICK(_claims(3, 3))()


@pytest.mark.heavy
@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_random_strokes(dim) -> None:
    THOROUGH(_claims(dim, 4))()
