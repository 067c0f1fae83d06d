"""Arrays of another body, of another type, or not finite are refused where they are handed over."""

import numpy as np
import pytest
from cut_bodies import cut_body, cut_membrane, material

from verify.xfem.block_pattern import block_pattern
from verify.xfem.errors import XfemError
from verify.xfem.internal_force import InternalForce
from verify.xfem.static_newton import collapsed_cells


@pytest.mark.parametrize("v", [cut_body(2), cut_body(3), cut_membrane()], ids=["2D", "3D", "sheet"])
def test_no_array_of_another_shape_or_type_reaches_a_compiled_loop(v):
    """They check no bounds: an array that was too short was written to beyond its end."""
    force = InternalForce(v, material(v.mesh.dim))
    pattern, good = block_pattern(v.cells, v.node_count), np.zeros(v.node_points.shape)
    space = good.shape[1]
    blocks = np.zeros((len(pattern.columns), space, space))
    other = block_pattern(v.mesh.cells[:1] * 0 + np.arange(v.mesh.dim + 1), v.mesh.dim + 1)
    few = np.zeros((len(other.columns), space, space))
    for wrong in (good[:-1], good[:, :1], good.astype("f4"), good.tolist()):
        for call in (
            lambda x: force.evaluate(x),
            lambda x: force.evaluate(good, out=x),
            lambda x: force.add_tangent_product(x, 1.0, good),
            lambda x: force.add_tangent_product(good, 1.0, x),
            lambda x: force.add_stiffness(pattern, blocks, 1.0, "consistent", x),
            lambda x: force.linearise(pattern, x, good, 1.0, 1.0, good, blocks),
            lambda x: force.linearise(pattern, good, x, 1.0, 1.0, good, blocks),
            lambda x: force.linearise(pattern, good, good, 1.0, 1.0, x, blocks),
            lambda x: collapsed_cells(force, x, 1e-3),
        ):
            with pytest.raises(XfemError, match=r"of shape .*; expected \(\d+, \d\), float64"):
                call(wrong)
        with pytest.raises(XfemError, match="of shape"):
            force.linearise(pattern, wrong, good, 1.0, 1.0, good, blocks)
        if force.is_membrane:
            with pytest.raises(XfemError, match="of shape"):
                force.add_stiffness(pattern, blocks, 1.0, "tension", wrong)
            with pytest.raises(XfemError, match="of shape"):
                force.add_tension_product(good, wrong, 1.0, good)
    for wrong in (blocks[:-1], blocks.astype("f4"), blocks[:, :, :1]):
        with pytest.raises(XfemError, match="blocks of shape"):
            force.add_stiffness(pattern, wrong)
    with pytest.raises(XfemError, match="expected that of the body"):
        force.add_stiffness(other, few)
