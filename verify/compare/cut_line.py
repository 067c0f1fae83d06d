"""Quadrature along the cuts, graded to their ends; each point has two sides."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import Body
from verify.compare.slabs import graded_breaks

__all__ = ["AWAY", "CutRule", "cut_rule", "place_on_cut"]

Array = NDArray[np.float64]

# Distance of `near` from the cut over the body's size. The direction to it is good to
# round-off over this, 1e-10: enough to tell the two sides of a sliver of 1e-9.
AWAY = 1e-6


@dataclass(frozen=True)
class CutRule:
    """Points on the cuts as asked.

    Parameters
    ----------
    points : (n, d) array
    weights : (n,) array
        Lengths (2D) or areas (3D) that the points stand for.
    normals : (n, d) array
        Unit normals into the positive side.
    positive, negative : (n, d) array
        Points close by on either side: `near` for a field.
    """

    points: Array
    weights: Array
    normals: Array
    positive: Array
    negative: Array


def cut_rule(body: Body, spacing: float, order: int = 3, depth: float = 1e-4) -> CutRule:
    """Quadrature along all cuts of a body, inside it.

    Parameters
    ----------
    body : Body
    spacing : float
        Largest distance that one Gauss rule covers, m.
    order : int
        Gauss points per cell.
    depth : float
        Size of the cells at the ends of a cut, relative to `spacing`.
    """
    x, w = np.polynomial.legendre.leggauss(order)
    rows = []
    for part in body.parts:
        ends = np.array([part.start, part.end])
        length = part.piece.length
        special = ends[_is_special(part.piece.point(ends), body)] * length
        breaks = graded_breaks(ends * length, special, spacing, depth * spacing) / length
        step = np.diff(breaks)
        t = (breaks[:-1, None] + step[:, None] * 0.5 * (x + 1)).ravel()
        weights = (step[:, None] * length * 0.5 * w).ravel()
        away = np.repeat(np.maximum(1e-3 * step * length, AWAY * body.size), order)
        rows.append((part.piece.point(t), weights, part.piece.tangent(t), away))
    if not rows:
        return CutRule(*(np.zeros(shape) for shape in ((0, 2), (0,), (0, 2), (0, 2), (0, 2))))
    points, weights, tangents, away = (np.concatenate(column) for column in zip(*rows, strict=True))
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    shift = away[:, None] * normals
    return CutRule(points, weights, normals, points + shift, points - shift)


def place_on_cut(body: Body, cut: str, fraction: float) -> CutRule:
    """Take the single point at a fraction of the length of a cut, as a rule of weight 1."""
    pieces = body.cuts[cut]
    lengths = np.array([piece.length for piece in pieces])
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    where = fraction * starts[-1]
    index = min(int(np.searchsorted(starts[1:], where)), len(pieces) - 1)
    t = np.array([np.clip((where - starts[index]) / lengths[index], 0.0, 1.0)])
    point, tangent = pieces[index].point(t), pieces[index].tangent(t)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    shift = AWAY * body.size * normal
    return CutRule(point, np.ones(1), normal, point + shift, point - shift)


def _is_special(points: Array, body: Body) -> NDArray[np.bool_]:
    if not len(body.singular):
        return np.zeros(len(points), dtype=bool)
    away = np.linalg.norm(points[:, None] - body.singular[None], axis=2).min(axis=1)
    return away <= 1e-12 * body.size
