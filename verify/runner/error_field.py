"""The error of a solution at its own nodes, as a file for pictures."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.locate import Field, SolutionField
from verify.compare.realised import field_of
from verify.compare.simplices import simplices
from verify.solution import Solution
from verify.whole_files import whole_file

__all__ = ["nodal_error", "write_error_field"]

# A node on the cut has no side, a point this share of the way into one of its cells has. The
# direction to the centre of a slender cell is no help: it runs along the cut.
_INTO_CELL = 0.01


def nodal_error(
    solution: Solution, truth: Field, body: AnyBody | None = None
) -> NDArray[np.float64]:
    """Magnitude of the displacement error at the nodes of `solution`, m.

    Both fields are taken a hundredth of the way from the node to the centre of its largest cell,
    so that a node on the cut is compared on its own side.

    Parameters
    ----------
    solution : Solution
        Its last output time counts.
    truth : Field
        The reference or exact field.
    body : Body, SolidBody or MembraneBody, optional
        Its cuts as asked: where they are not as realised, the truth is asked on the side of the
        solution's cell.

    Returns
    -------
    (n,) array
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
    field = SolutionField(solution) if body is None else field_of(solution, body)
    own, _ = field.in_cells(inside, owner[used])
    error = np.zeros(len(points))
    beside = field.inner_points(owner[used])
    error[used] = np.linalg.norm(own - truth.displacement(inside, beside), axis=1)
    return error


def write_error_field(
    solution: Solution, truth: Field, path: Path, body: AnyBody | None = None
) -> None:
    """Write the mesh of `solution` with point data ``error`` (m) and ``displacement`` (m)."""
    import meshio

    points = np.zeros((len(solution.points), 3))
    points[:, : solution.dimension] = solution.points
    displacement = np.zeros_like(points)
    displacement[:, : solution.dimension] = solution.displacement[-1]
    mesh = meshio.Mesh(
        points,
        [(solution.cell_type, solution.cells)],
        point_data={"error": nodal_error(solution, truth, body), "displacement": displacement},
    )
    with whole_file(path) as partial:
        mesh.write(partial, file_format="vtu")
