"""States of a motion handed on where a cut opens."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.errors import InputError

pytestmark = needs_fenicsx

MIDDLE = np.array([[0.0, -1.0], [0.0, 1.0]])


def spaces(lower, upper, counts, cut, degree=1):
    """Give one mesh twice: with its cut closed, and open."""
    from reference.space import conforming_space

    points, cells, facets = imprint(*structured_triangles(lower, upper, counts), [cut])
    none = np.zeros((0, 2), dtype=np.int64)
    return [conforming_space(open_cut(points, cells, f), degree) for f in (none, facets)]


def test_a_state_is_not_carried_over_to_another_mesh():
    from reference.dynamics import inherit

    closed, _ = spaces((-1.0, 0.0), (1.0, 1.0), (4, 4), MIDDLE)
    other, _ = spaces((-1.0, 0.0), (1.0, 1.0), (6, 4), MIDDLE)
    with pytest.raises(InputError, match="does not have the cells"):
        inherit(closed, other, closed.node_points)
