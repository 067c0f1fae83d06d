"""Displacement error of a body with slivers, against the exact field of the cut as asked."""

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_solution
from verify.scene import Material as SceneMaterial
from verify.study.slivers.bodies import POISSON, SweptBody, soft
from verify.xfem.quadrature import simplex_rule
from verify.xfem.slivers import GhostPenalty
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import subdivide
from verify.xfem.supports import Supports

__all__ = ["displacement_error"]

_DEGREE = 6
_Floats = NDArray[np.float64]


class _Field:
    """F3 on both sides of the cut along faces; in space constant along the second axis."""

    def __init__(self, body: SweptBody) -> None:
        level = float(body.cut.level_set(np.zeros((1, body.dimension)))[0])
        self._level = -level
        self._exact = exact_solution(
            "airy",
            {
                "point": [0.5, self._level],
                "slope": 0.0,
                "above": [0.1, 0.2, 2.0],
                "below": [-0.2, 0.1, 3.0],
            },
            SceneMaterial(young=1.0, poisson=POISSON, plane="strain"),
        )

    def __call__(self, points: _Floats, above: NDArray[np.bool_]) -> _Floats:
        plane = points[:, [0, -1]]
        near = np.column_stack([plane[:, 0], self._level + np.where(above, 1.0, -1.0)])
        field = np.zeros_like(points)
        field[:, [0, -1]] = self._exact.displacement(plane, near)
        return field


def displacement_error(body: SweptBody) -> float:
    """‖u − u_exact‖/‖u_exact‖ in L2, with the exact field prescribed on the boundary.

    The side of the exact field is that of the cut as asked, so that a policy which moves the cut
    pays for it.

    Raises
    ------
    ValueError
        If the cut is not placed along faces: the field is that of a level cut.
    """
    if body.placement != "along faces":
        raise ValueError(f"cut {body.placement}; the exact field is that of a cut along faces")
    virtual, field = body.virtual, _Field(body)
    fixed = np.zeros(virtual.node_points.shape, dtype=bool)
    ends = (virtual.node_points < 1e-9) | (virtual.node_points > 1.0 - 1e-9)
    fixed[ends.any(axis=1)] = True
    values = np.where(fixed, field(virtual.node_points, body.node_above), 0.0)
    solution = solve_static(
        virtual, soft(body.dimension, young=1.0), Supports(fixed, values), ghost=_unit_ghost(body)
    )
    divided = subdivide(virtual)
    corners = divided.points[divided.cells]
    nodal = (divided.interpolation @ solution.displacement)[divided.cells]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    above = body.cut.level_set(corners.mean(axis=1)) > 0.0
    error = size = 0.0
    for point, weight in zip(*simplex_rule(body.dimension, _DEGREE), strict=True):
        want = field(np.einsum("k,ckd->cd", point, corners), above)
        got = np.einsum("k,ckd->cd", point, nodal)
        error += weight * float(volumes @ ((got - want) ** 2).sum(axis=1))
        size += weight * float(volumes @ (want**2).sum(axis=1))
    return float(np.sqrt(error / size))


def _unit_ghost(body: SweptBody) -> GhostPenalty | None:
    if body.ghost is None:
        return None
    return GhostPenalty(body.virtual, soft(body.dimension, young=1.0), body.ghost.factor)
