"""Arrays from outside: what makes no sense, and shapes and types at compiled loops."""

import numpy as np
import pytest
from cut_bodies import cut_body, cut_membrane, material

from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.arrays import XfemError
from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import ImplicitCut, Plane, PolygonPatch, ToolPath, TriangulatedSurface
from verify.xfem.element import isotropic
from verify.xfem.explicit import critical_step, element_critical_steps
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports, body_force, traction
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import collapsed_cells, solve_static

PLATE, BLOCK = rectangle_mesh((4, 4)), box_mesh((2, 2, 2))
CUT = cut_mesh(PLATE, [Plane([0.5, 0.53], [0.0, 1.0])])
SOFT = isotropic(1e4, 0.3, "plane strain")
SWEEP = ToolPath.of_tip([[0.0, 0.4], [1.0, 0.4]], [0.0, 1.0]).sweep
BLADE = ToolPath.of_tip([[0.0, 0.4, 0.0], [1.0, 0.4, 0.0]], [0.0, 1.0], [0.0, 0.0, 1.0]).sweep
RIM = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
ALL = np.ones(CUT.node_points.shape, dtype=bool)
NAN = np.nan


def to_the_left(extent):
    return ImplicitCut(lambda x: x[:, 0] - 0.4, extent)


def stiffness():
    pattern = block_pattern(CUT.cells, CUT.node_count)
    return pattern.matrix(InternalForce(CUT, SOFT, "linear").stiffness(pattern))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        # a kernel would read past the end of its arrays
        (lambda: cut_mesh(PLATE, [BLADE]), "points"),
        (lambda: cut_mesh(BLOCK, [SWEEP]), r"expected \(n, 2\)"),
        (lambda: cut_mesh(PLATE, [to_the_left(lambda x: np.ones(1))]), "depth"),
        # nothing would be cut, and nothing said
        (lambda: cut_mesh(PLATE, [to_the_left(lambda x: np.full(len(x), NAN))]), "or NaN"),
        (lambda: PolygonPatch([*RIM, [NAN, 1.0, 0.0]]), "not finite"),
        (lambda: SemiProgressiveCutter(PLATE).advance(NAN), "time nan; expected a number"),
        # a cut of another space, or none
        (lambda: cut_mesh(PLATE, [Plane([0, 0, 0], [1, 0, 0])]), "points"),
        (lambda: cut_mesh(PLATE, [None]), "NoneType"),
        # numbers that are none, rows that differ, indices that are no integers
        (lambda: SimplexMesh([[0, 0], [1j, 0], [0, 1]], [[0, 1, 2]]), "expected real numbers"),
        (lambda: TriangulatedSurface(RIM, [[0.0, 1.0, 2.7]]), "surface triangles"),
        (lambda: side_wise_mass(CUT, 1.0).weight(9.8), "vector"),
        (lambda: GhostPenalty(CUT, isotropic(np.ones(3), 0.3, "plane strain")), r"expected \(\)"),
        (lambda: Supports.none(CUT).prescribe(CUT, [0.7, 1.2]), "supported nodes"),
        (lambda: solve_static(CUT, SOFT, Supports(ALL, np.where(ALL, NAN, 0.0))), "not finite"),
        (lambda: traction(CUT, [[0.7, 1.2]], [1.0, 0.0]), "loaded facets"),
        (lambda: body_force(CUT, lambda x, s: x, -1), "degree -1"),
        # an infinite or missing step
        (lambda: element_critical_steps(PLATE, SOFT, -1.0), "density -1"),
        (lambda: critical_step(stiffness() * NAN, side_wise_mass(CUT, 1.0)), "not finite"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(make, message):
    with pytest.raises(XfemError, match=message) as raised:
        make()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("v", [cut_body(2), cut_membrane()], ids=["2D", "sheet"])
def test_no_array_of_another_shape_or_type_reaches_a_compiled_loop(v):
    """They check no bounds: an array that was too short was written to beyond its end."""
    force = InternalForce(v, material(v.mesh.dim))
    pattern, good = block_pattern(v.cells, v.node_count), np.zeros(v.node_points.shape)
    space, at = good.shape[1], force.configuration(good)
    blocks = np.zeros((len(pattern.columns), space, space))
    other = block_pattern(v.mesh.cells[:1] * 0 + np.arange(v.mesh.dim + 1), v.mesh.dim + 1)
    calls = [
        lambda x: force.evaluate(x),
        lambda x: force.evaluate(good, out=x),
        lambda x: force.configuration(x),
        lambda x: force.add_tangent_product(at, x, 1.0, good),
        lambda x: force.add_tangent_product(at, good, 1.0, x),
        lambda x: force.linearise(pattern, x, good, 1.0, 1.0, good, blocks),
        lambda x: force.linearise(pattern, good, x, 1.0, 1.0, good, blocks),
        lambda x: force.linearise(pattern, good, good, 1.0, 1.0, x, blocks),
        lambda x: collapsed_cells(force, x, 1e-3),
    ]
    if force.is_membrane:
        calls.append(lambda x: force.add_tension_product(at, x, 1.0, good))
    for wrong in (good[:-1], good[:, :1], good.astype("f4"), good.tolist()):
        for call in calls:
            with pytest.raises(XfemError, match=r"of shape .*; expected \(\d+, \d\), float64"):
                call(wrong)
        with pytest.raises(XfemError, match="of shape"):
            force.linearise(pattern, wrong, good, 1.0, 1.0, good, blocks)
    for wrong in (blocks[:-1], blocks.astype("f4"), blocks[:, :, :1]):
        with pytest.raises(XfemError, match="blocks of shape"):
            force.add_stiffness(at, pattern, wrong)
    with pytest.raises(XfemError, match="expected that of the body"):
        force.add_stiffness(at, other, np.zeros((len(other.columns), space, space)))
