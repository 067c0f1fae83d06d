"""The error of a solution at its own nodes, and what it is the error against."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, body_of
from verify.compare.cut_deviation import continued_where
from verify.compare.locate import Field, SolutionField
from verify.compare.motion import ExactMotion
from verify.compare.realised import cut_deviation, field_of
from verify.compare.simplices import simplices
from verify.errors import InputError
from verify.records import CutRecord
from verify.scene import Scene
from verify.solution import Solution
from verify.whole_files import whole_file

Array = NDArray[np.float64]
Truth = Callable[[float], Field]  # the reference or exact field at an output time, s

# A node on the cut has no side, a point this share of the way into one of its cells has. The
# direction to the centre of a slender cell is no help: it runs along the cut.
_INTO_CELL = 0.01
_SAME_TIME = 1e-9  # of the last output time


def truth_of(
    scene: Scene, references: Mapping[int, Solution], judged: Sequence[Solution], exact: Any
) -> Truth | None:
    """Return the field that a scene is judged by, over time; None without one.

    Parameters
    ----------
    scene : Scene
    references : mapping of int to Solution
        Solutions of the reference by level; the finest counts where no exact one is asked.
    judged : sequence of Solution
        Whose cuts may deviate from the cuts as asked.
    exact : object with ``displacement`` and ``gradient``, or None
    """
    if scene.judged_by_exact:
        return ExactMotion(exact).at
    if not references:
        return None
    body, reference = body_of(scene), references[max(references)]
    deviation = max((cut_deviation(own, body) for own in judged), default=0.0)
    field = field_of(reference, body, deviation=deviation)

    def at(time: float) -> Field:
        step = int(np.argmin(np.abs(reference.times - time)))
        if abs(reference.times[step] - time) > _SAME_TIME * reference.times[-1]:
            raise InputError(f"the reference has no output at {time:.6g} s")
        return field.with_nodal(reference.displacement[step])

    return at


def nodal_differences(
    solution: Solution, truth: Truth, body: AnyBody | None = None, steps: Sequence[int] = (-1,),
    cut: CutRecord | None = None,
) -> Array:  # fmt: skip
    """Displacement of a solution less the true one, at its nodes, m.

    Both fields are taken a hundredth of the way from the node to the centre of its largest cell,
    so that a node on the cut is compared on its own side.

    Parameters
    ----------
    solution : Solution
    truth : callable
        The reference or exact field at a time, s.
    body : Body, SolidBody or MembraneBody, optional
        Its cuts as asked: where they are not as realised, the truth is asked on the side of the
        solution's cell.
    steps : sequence of int
        Output times that are looked at; default the last.
    cut : CutRecord, optional
        Of its realised cut: beside facets beyond its limit that side is the one as realised.

    Returns
    -------
    (k, n, d) array
        0 at nodes that no cell uses.
    """
    points, cells = solution.points, solution.cells
    shape = simplices(points, cells)
    owner = np.full(len(points), -1)
    order = np.argsort(shape.volume, kind="stable")  # of what is assigned twice, the last stays
    owner[cells[order].ravel()] = np.repeat(order, cells.shape[1])
    used = owner >= 0
    centre = shape.corners.mean(axis=1)[owner[used]]
    inside = points[used] + _INTO_CELL * (centre - points[used])
    field = SolutionField(solution)
    if body is not None:
        field = field_of(solution, body, continued=continued_where(solution, body, cut))
    beside = field.inner_points(owner[used])
    difference = np.zeros((len(steps), *points.shape))
    for k, step in enumerate(steps):
        own, _ = field.with_nodal(solution.displacement[step]).in_cells(inside, owner[used])
        true = truth(float(solution.times[step])).displacement(inside, beside)
        difference[k, used] = own - true
    return difference


def nodal_error(
    solution: Solution, truth: Field, body: AnyBody | None = None, cut: CutRecord | None = None
) -> Array:
    """Magnitude (n,) of the displacement error at the last output time, as `nodal_differences`."""
    return np.linalg.norm(nodal_differences(solution, lambda _: truth, body, cut=cut)[0], axis=1)


def write_error_field(
    solution: Solution, truth: Field, path: Path, body: AnyBody | None = None,
    cut: CutRecord | None = None,
) -> None:  # fmt: skip
    """Write the mesh of `solution` with point data ``error`` (m) and ``displacement`` (m)."""
    import meshio

    points = np.zeros((len(solution.points), 3))
    points[:, : solution.dimension] = solution.points
    displacement = np.zeros_like(points)
    displacement[:, : solution.dimension] = solution.displacement[-1]
    mesh = meshio.Mesh(
        points,
        [(solution.cell_type, solution.cells)],
        point_data={"error": nodal_error(solution, truth, body, cut), "displacement": displacement},
    )
    with whole_file(path) as partial:
        mesh.write(partial, file_format="vtu")
