"""The error of a solution at its own nodes, as a file for pictures."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.compare.locate import Field
from verify.solution import Solution

__all__ = ["nodal_error", "write_error_field"]


def nodal_error(solution: Solution, truth: Field) -> NDArray[np.float64]:
    """Magnitude of the displacement error at the nodes of `solution`, m.

    A node on the cut is compared on the side of its own largest cell.

    Parameters
    ----------
    solution : Solution
        Its last output time counts.
    truth : Field
        The reference or exact field.

    Returns
    -------
    (n,) array
        0 at nodes that no cell uses.
    """
    points, cells = solution.points, solution.cells
    corners = points[cells[:, : solution.dimension + 1]]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    near = np.full_like(points, np.nan)
    order = np.argsort(volume, kind="stable")  # of what is assigned twice, the last stays
    near[cells[order].ravel()] = np.repeat(corners[order].mean(axis=1), cells.shape[1], axis=0)
    used = np.isfinite(near[:, 0])
    error = np.zeros(len(points))
    difference = solution.displacement[-1][used] - truth.displacement(points[used], near[used])
    error[used] = np.linalg.norm(difference, axis=1)
    return error


def write_error_field(solution: Solution, truth: Field, path: Path) -> None:
    """Write the mesh of `solution` with point data ``error`` (m) and ``displacement`` (m)."""
    import meshio

    points = np.zeros((len(solution.points), 3))
    points[:, : solution.dimension] = solution.points
    displacement = np.zeros_like(points)
    displacement[:, : solution.dimension] = solution.displacement[-1]
    mesh = meshio.Mesh(
        points,
        [(solution.cell_type, solution.cells)],
        point_data={"error": nodal_error(solution, truth), "displacement": displacement},
    )
    partial = path.with_suffix(".partial")
    mesh.write(partial, file_format="vtu")
    os.replace(partial, path)
