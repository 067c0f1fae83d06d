"""Each version of DOLFINx, told by its number, is given what it wants."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from reference.installation import create_simplex_mesh, import_dolfinx


@needs_fenicsx[0]
@needs_fenicsx[1]
@pytest.mark.parametrize("version, points_at", [("0.9.0", 2), ("0.10.0.post5", 3), ("0.11.0", 3)])
def test_points_of_a_mesh_stand_where_the_version_wants_them(monkeypatch, version, points_at):
    dolfinx = import_dolfinx()
    from dolfinx import mesh

    taken = []
    monkeypatch.setattr(dolfinx, "__version__", version)
    monkeypatch.setattr(mesh, "create_mesh", lambda *arguments: taken.extend(arguments))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    create_simplex_mesh(points, np.array([[0, 1, 2]]))
    assert taken[points_at] is points
