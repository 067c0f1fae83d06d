"""Whatever a user gives, one error says what it was: kernels have no bounds checks of their own."""

import numpy as np
import pytest

from verify.accelerated.resumable import finished
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.bases import from_sidewise, sidewise_from
from verify.xfem.block_pattern import block_pattern
from verify.xfem.critical_step import critical_step, element_critical_steps
from verify.xfem.cuts import (
    ImplicitCut,
    Plane,
    PolygonPatch,
    Polyline,
    ToolPath,
    TriangulatedSurface,
)
from verify.xfem.elasticity import isotropic
from verify.xfem.errors import XfemError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads import body_force, traction
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports

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
        (lambda: SWEEP.depth(np.zeros(2)), "points"),
        (lambda: cut_mesh(PLATE, [to_the_left(lambda x: np.ones(1))]), "depth"),
        (lambda: cut_mesh(PLATE, [to_the_left(lambda x: 1.0)]), "depth"),
        # nothing would be cut, and nothing said
        (lambda: cut_mesh(PLATE, [to_the_left(lambda x: np.full(len(x), NAN))]), "or NaN"),
        (lambda: PolygonPatch([*RIM, RIM[0]]), "corners 3 and 0 of the polygon are in one place"),
        (lambda: PolygonPatch([*RIM, [NAN, 1.0, 0.0]]), "not finite"),
        (lambda: SemiProgressiveCutter(PLATE).advance(NAN), "time nan; expected a number"),
        (lambda: SemiProgressiveCutter(PLATE).advance("soon"), "seconds"),
        (lambda: finished(SemiProgressiveCutter(PLATE).looking(1.0, 0)), "elements"),
        # a cut of another space, or none
        (lambda: cut_mesh(PLATE, [Plane([0, 0, 0], [1, 0, 0])]), "points"),
        (lambda: cut_mesh(BLOCK, [Polyline([[0, 0], [1, 1]])]), "polyline"),
        (lambda: cut_mesh(PLATE, [PolygonPatch(RIM)]), "points"),
        (lambda: cut_mesh(PLATE, [TriangulatedSurface(RIM, [[0, 1, 2]])]), "surface"),
        (lambda: cut_mesh(PLATE, Plane([0, 0], [1, 0])), "Plane"),
        (lambda: cut_mesh(PLATE, [None]), "NoneType"),
        (lambda: cut_mesh(PLATE, [ImplicitCut(lambda x: None)]), "cut 0: level set"),
        # numbers that are none, rows that differ, indices that are no integers
        (lambda: SimplexMesh("abc", [[0, 1, 2]]), "points"),
        (lambda: SimplexMesh([[0, 0], [1], [0, 1]], [[0, 1, 2]]), "mesh points"),
        (lambda: SimplexMesh([[0, 0], [1j, 0], [0, 1]], [[0, 1, 2]]), "expected real numbers"),
        (lambda: SimplexMesh(PLATE.points, [[0, 1, 2], [0, 1]]), "different"),
        (lambda: Plane("ab", [0, 1]), "plane at 'ab'"),
        (lambda: Polyline("ab"), "polyline"),
        (lambda: ToolPath.of_tip([[0, 0], [1]], [0, 1]), "tip points"),
        (lambda: TriangulatedSurface(RIM, [[0.0, 1.0, 2.7]]), "surface triangles"),
        (lambda: TriangulatedSurface([[0, 0, 0], [1, 0, 0], [0.5, 1e-13, 0]], [[0, 1, 2]]), "area"),
        (lambda: side_wise_mass(CUT, "heavy"), "density 'heavy'"),
        (lambda: side_wise_mass(CUT, 1.0).weight(9.8), "vector"),
        (lambda: isotropic(np.ones(3), np.full(4, 0.3), "solid"), r"shape \(3,\), Poisson"),
        (lambda: GhostPenalty(CUT, isotropic(np.ones(3), 0.3, "plane strain")), r"expected \(\)"),
        (lambda: GhostPenalty(CUT, SOFT, "some"), "factor 'some'"),
        (lambda: treat_slivers(CUT, "merge", "some"), "threshold 'some'"),
        (lambda: Supports.none(CUT).prescribe(CUT, [0.7, 1.2]), "supported nodes"),
        (lambda: Supports.none(CUT).prescribe(CUT, [0], components=0), "components 0"),
        (lambda: Supports.none(cut_mesh(BLOCK, [])).prescribe(CUT, [0]), r"supports of shape"),
        (lambda: solve_static(CUT, SOFT, Supports(ALL.astype(float), 0.0 * ALL)), "type float64"),
        (lambda: solve_static(CUT, SOFT, Supports(ALL, np.where(ALL, NAN, 0.0))), "not finite"),
        (lambda: solve_static(CUT, SOFT, Supports(ALL, np.zeros(2))), r"values of shape \(2,\)"),
        (lambda: traction(CUT, [[0.7, 1.2]], [1.0, 0.0]), "loaded facets"),
        (lambda: traction(CUT, [0, 1, 2], [1.0, 0.0]), r"shape \(3,\); expected \(b, 2\)"),
        (lambda: body_force(CUT, lambda x, s: x, -1), "degree -1"),
        (lambda: body_force(CUT, lambda x, s: None), "load density"),
        (lambda: sidewise_from(CUT, "shifted", np.zeros((3, 2))), "unknowns"),
        (lambda: from_sidewise(CUT, "shifted", np.zeros((99, 2))), r"displacements of shape"),
        # an infinite or missing step
        (lambda: element_critical_steps(PLATE, SOFT, -1.0), "density -1"),
        (lambda: element_critical_steps(PLATE, SOFT, [1.0, 2.0]), "density"),
        (lambda: critical_step(stiffness() * NAN, side_wise_mass(CUT, 1.0)), "not finite"),
        (lambda: critical_step(stiffness(), side_wise_mass(CUT, 1.0), [0.0] * 70), "one bool"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_sentence(make, message):
    with pytest.raises(XfemError, match=message) as raised:
        make()
    assert "\n" not in str(raised.value)
