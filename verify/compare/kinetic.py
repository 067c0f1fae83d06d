"""Kinetic energy and momenta of a solution, from its velocities with the consistent mass."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.simplex_rule import simplex_rule
from verify.compare.simplices import EDGES, simplices
from verify.errors import InputError
from verify.scene import Scene
from verify.solution import Solution

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kinetic:
    """Over the output times of a solution (2D: per metre of thickness).

    Parameters
    ----------
    mass : float
        kg.
    centre : (t, d) array
        Current centre of mass, m.
    energy : (t,) array
        ½ ∫ ρ v², J.
    linear : (t, d) array
        ∫ ρ v, N s.
    angular : (t, 1 or 3) array
        ∫ ρ x × v about the origin, x the current position, N m s.
    spin : (t, 1 or 3) array
        The same about the current centre of mass, N m s.
    linear_scale, angular_scale : float
        Largest ∫ ρ |v| and ∫ ρ |x − c||v| over time, c the centre of mass: what the momenta
        are small against when they cancel.
    """

    mass: float
    centre: Array
    energy: Array
    linear: Array
    angular: Array
    spin: Array
    linear_scale: float
    angular_scale: float


def density_of(scene: Scene, solution: Solution) -> float | Array:
    """Density in kg/m³ (of a membrane kg/m²): one, or (m,) that at the centroid of each cell.

    0 where the scene has none.
    """
    material = scene.material
    thickness = material.thickness or 1.0
    if material.is_uniform:
        return thickness * (material.density or 0.0)
    shape = simplices(solution.points, solution.cells)
    return thickness * np.nan_to_num(material.at(shape.corners.mean(axis=1)).density)


def kinetic(
    solution: Solution, density: float | Array, cells: NDArray[np.int64] | None = None
) -> Kinetic:
    """Integrate over the cells of the solution, exactly for its velocity field.

    Parameters
    ----------
    solution : Solution
    density : float or (m,) array
        kg/m³, of a membrane times its thickness; of all cells of the solution or of each.
    cells : (c,) int array, optional
        Numbers of the cells of a part; default all.

    Raises
    ------
    InputError
        If the solution has no velocities.
    """
    if solution.velocity is None:
        raise InputError("a solution without velocities has no kinetic energy")
    d, k = solution.dimension, solution.cell_dimension
    nodes = solution.cells if cells is None else solution.cells[cells]
    shape = simplices(solution.points, nodes)
    place, share = simplex_rule(k, 2 if solution.order == 1 else 4)
    hats = shape_functions(place, k, solution.order)
    own = density if cells is None or np.ndim(density) == 0 else np.asarray(density)[cells]
    mass = ((own * shape.volume)[:, None] * share).ravel()
    names = ("centre", "energy", "linear", "angular", "spin", "scales")
    rows: dict[str, list[Array]] = {name: [] for name in names}
    for u, v in zip(solution.displacement, solution.velocity, strict=True):
        x, speed = (
            np.einsum("qk,mka->mqa", hats, nodal[nodes]).reshape(-1, d)
            for nodal in (solution.points + u, v)
        )
        size = np.linalg.norm(speed, axis=1)
        centre = mass @ x / max(mass.sum(), 1e-300)
        rows["centre"].append(centre)
        arm = np.linalg.norm(x - centre, axis=1)
        rows["energy"].append(0.5 * mass @ size**2)
        rows["linear"].append(mass @ speed)
        rows["angular"].append(mass @ _cross(x, speed))
        rows["spin"].append(mass @ _cross(x - centre, speed))
        rows["scales"].append(np.array([mass @ size, mass @ (arm * size)]))
    scales = np.max(rows["scales"], axis=0)
    return Kinetic(
        float(mass.sum()), np.array(rows["centre"]), np.array(rows["energy"]),
        np.array(rows["linear"]), np.array(rows["angular"]), np.array(rows["spin"]),
        float(scales[0]), float(scales[1]),
    )  # fmt: skip


def _cross(x: Array, v: Array) -> Array:
    """Cross product (n, 3), in the plane its only component (n, 1)."""
    return np.cross(x, v) if x.shape[1] == 3 else x[:, :1] * v[:, 1:] - x[:, 1:] * v[:, :1]


def shape_functions(place: Array, k: int, order: int) -> Array:
    """Values (q, n) of the nodes' shape functions at barycentric points (q, k + 1)."""
    if order == 1:
        return place
    edges = [4 * place[:, a] * place[:, b] for a, b in EDGES[k]]
    return np.column_stack([place * (2 * place - 1), *edges])
