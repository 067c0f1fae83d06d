"""Table 4.3 and Figure 4.11: nodes that each method adds while incisions grow."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from verify.methods.catalogue import cut_by
from verify.methods.cut_body import CutBody
from verify.scene import load_scene
from verify.simulator import Stage, stage_of
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.simulator.thesis.delays import published_rows
from verify.xfem.arrays import Floats
from verify.xfem.block_pattern import block_pattern
from verify.xfem.critical_step import critical_step
from verify.xfem.cuts import Polyline, ToolPath
from verify.xfem.elasticity import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.structured_meshes import rectangle_mesh

THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3)  # of an edge: nodes as near as that are snapped
_HEIGHT = 0.43  # of the strip: away from nodes and from the middles of edges


@dataclass(frozen=True)
class StripCount:
    """A strip of triangles, cut along from border to border.

    Attributes
    ----------
    pattern : str
        Of the diagonals.
    triangles : int
        That are cut through.
    enriched : int
        Nodes that XFEM enriches.
    """

    pattern: str
    triangles: int
    enriched: int


@dataclass(frozen=True)
class FaceCount:
    """Nodes added on the face.

    Attributes
    ----------
    asked : int
        Row of Table 4.3.
    cuts : int
        Elements that were split when at least so many were.
    strokes : int
        That the tool had begun.
    added : dict of str to int
        By method; ``xfem played`` is counted on the membrane, semi-progressively, all others on
        its plan: the blade is parallel to the line of sight, so that the same edges are crossed
        at the same places.
    smallest : dict of str to float
        Smallest volume of an element or a piece of one over that of its element.
    step : dict of str to float
        Critical explicit step of the plan as a free sheet, masses lumped, over that of the uncut
        one.
    thesis : dict of str to int
        The thesis' increments.
    """

    asked: int
    cuts: int
    strokes: int
    added: dict[str, int]
    smallest: dict[str, float]
    step: dict[str, float]
    thesis: dict[str, int]


def count_strips(lengths: Sequence[int]) -> list[StripCount]:
    """Cut strips of so many squares, divided by diagonals in each of the patterns."""
    counts = []
    for pattern in ("right", "left", "alternating", "crossed"):
        for length in lengths:
            mesh = rectangle_mesh((length, 1), (0.0, 0.0), (float(length), 1.0), pattern)
            cut = Polyline([[-1.0, _HEIGHT], [length + 1.0, _HEIGHT]])
            phantom = cut_mesh(mesh, [cut])
            through = int((np.bincount(phantom.parent) > 1).sum())
            counts.append(StripCount(pattern, through, phantom.node_count - len(mesh.points)))
    return counts


def count_face(rows: Sequence[int]) -> list[FaceCount]:
    """Let incisions grow over the face until so many elements are split.

    Parameters
    ----------
    rows : sequence of int
        Of Table 4.3, ascending, without 0.
    """
    stage = stage_of(load_scene("thesis/face_thousand_cuts"))
    # the positive direction of the plan is that of the membrane: it is a graph over x and y
    plan = SimplexMesh(stage.mesh.points[:, :2], stage.mesh.cells)
    uncut = _step_of_body(cut_by("uncut", plan, []))
    thesis = {int(row[0]): row for row in published_rows("4.3")}
    counts = []
    for asked, (cuts, played, time) in zip(rows, _growth(stage, rows), strict=True):
        lines = [Polyline(tips) for tips in _tips_until(stage.strokes, time)]
        bodies = {
            "xfem": cut_by("virtual_node_arbitrary", plan, lines),
            "subdivision": cut_by("subdivision", plan, lines),
            "snapping": cut_by("snapping", plan, lines),
        }
        for threshold in THRESHOLDS:
            name = f"snapping_subdivision {threshold:g}"
            bodies[name] = cut_by("snapping_subdivision", plan, lines, threshold=threshold)
        sizes = {name: body.counts for name, body in bodies.items()}
        added = {"xfem played": played}
        added |= {name: size.nodes - size.nodes_before for name, size in sizes.items()}
        step = {name: _step_of_body(body) / uncut for name, body in bodies.items()}
        smallest = {name: body.smallest_fraction for name, body in bodies.items()}
        own = thesis[asked]
        said = {"xfem": int(own[3]), "snapping_subdivision": int(own[4])}
        counts.append(FaceCount(asked, cuts, len(lines), added, smallest, step, said))
    return counts


def _growth(stage: Stage, rows: Sequence[int]) -> list[tuple[int, int, float]]:
    """Elements split, nodes added and time when so many elements were split."""
    cutter = SemiProgressiveCutter(stage.mesh)
    for path in stage.strokes:
        cutter.begin(path)
    found: list[tuple[int, int, float]] = []
    frame = 0.25 * stage.time_step
    for k in range(1, 4 * stage.steps + 1):
        if len(found) == len(rows):
            break
        cutter.advance(k * frame)
        split = int(np.count_nonzero(cutter.body.split_cells))
        while len(found) < len(rows) and split >= rows[len(found)]:
            added = cutter.phantom_mesh().node_count - len(stage.mesh.points)
            found.append((split, added, k * frame))
    if len(found) < len(rows):
        raise ValueError(f"the strokes split {split} elements; expected {rows[-1]}")
    return found


def _tips_until(strokes: Sequence[ToolPath], time: float) -> list[Floats]:
    """Plan (k, 2) of what each tip has come along, of the strokes that have begun."""
    tips = []
    for path in strokes:
        if path.times[0] >= time:
            continue
        last = [np.interp(time, path.times, path.blades[:, 0, i]) for i in range(2)]
        before = path.times < min(time, path.times[-1])
        tips.append(np.concatenate([path.blades[before, 0, :2], [last]]))
    return tips


def _step_of_body(body: CutBody) -> float:
    """Critical step 2/ω_max of a free sheet of Table 4.1 that has been cut, in s."""
    material = body.material(isotropic(1.0e4, 0.3, "plane stress"))
    pattern = block_pattern(body.resisting.cells, body.resisting.node_count)
    blocks = InternalForce(body.resisting, material, "linear").stiffness(pattern)
    return critical_step(csr_array(pattern.matrix(blocks)), side_wise_mass(body.phantom, 1000.0))
