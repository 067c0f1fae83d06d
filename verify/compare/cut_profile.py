"""Openings of cuts: at a place, and along the line that an opening profile is drawn on.

A cut in the plane, or in a membrane, is such a line itself. On a cut in space one line is taken:

- the longer axis of a disc, a meridian of a sphere;
- the arc of a cylinder at half its height, the line half-way along a swept polyline;
- of a polygon the line through its centroid along its longest direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body
from verify.compare.cut_rule import (
    AWAY,
    CutRule,
    nearest_on_cut,
    nearest_on_membrane_cut,
    place_on_cut,
)
from verify.compare.errors import displacement_jump
from verify.compare.locate import Field
from verify.compare.simplex_bodies import MembraneBody, SolidBody
from verify.geometry.patches import (
    CylinderPatch,
    DiscPatch,
    Patch,
    PlanePatch,
    SpherePatch,
)
from verify.geometry.planar import arc_lengths
from verify.geometry.simplices import determinants

Array = NDArray[np.float64]


def opening(
    field: Field, body: AnyBody, cut: str, place: float | Sequence[float], component: str
) -> float:
    """Compute the jump in m at a place of a cut, along its normal or its tangent.

    In the plane the place is a fraction of the cut's length, and the tangent goes along the cut's
    direction. In space it is the point of the cut nearest to a given one, and the tangential jump
    is a length: the jump without its normal part. The normal points into the positive side; of a
    membrane it lies in the surface.
    """
    at = cut_place(body, cut, place)
    normal, jump = at.normals[0], displacement_jump(field, at)[0]
    if component == "normal":
        return float(jump @ normal)
    if body.dimension == 2:
        return float(jump @ np.array([normal[1], -normal[0]]))
    return float(np.linalg.norm(jump - (jump @ normal) * normal))


def cut_place(body: AnyBody, cut: str, place: float | Sequence[float]) -> CutRule:
    """Take the point of a cut at which an opening is measured, as a rule of weight 1."""
    if isinstance(body, Body):
        assert isinstance(place, float)
        return place_on_cut(body, cut, place)
    point = np.array(place, dtype=float)
    if isinstance(body, MembraneBody):
        return nearest_on_membrane_cut(body, cut, point)
    return nearest_on_cut(body, cut, point)


def point_displacement(field: Field, point: Sequence[float], component: str) -> float:
    """Compute the displacement in m of `point` in direction ``x``, ``y`` or ``z``."""
    at = np.array([point], dtype=float)
    return float(field.displacement(at, at)[0, "xyz".index(component)])


_POINTS = 48  # per straight or curved piece, denser to its ends, where an opening ends in a root
_PIECES = 200  # of a cut through the triangles of a membrane; of more every n-th is taken
_FINE = 4000  # points that the extent of a line on a polygon is found by


@dataclass(frozen=True)
class ProfileLine:
    """A line on a cut.

    Parameters
    ----------
    cut : str
        Name of the cut.
    where : str
        Which line it is, in words.
    arc : (n,) array
        Arc length, m; 0 at the first point.
    rule : CutRule
        The points with their sides; all weights are 1.
    """

    cut: str
    where: str
    arc: Array
    rule: CutRule


def profile_lines(body: AnyBody) -> list[ProfileLine]:
    """Take a line on every cut of a body, inside the body."""
    if isinstance(body, MembraneBody):
        lines = [_on_membrane(body, cut) for cut in body.lines]
    elif isinstance(body, SolidBody):
        lines = [_on_surface(body, cut) for cut in body.cuts]
    else:
        lines = [_in_plane(body, cut) for cut in body.cuts]
    return [line for line in lines if len(line.arc)]


def _in_plane(body: Body, cut: str) -> ProfileLine:
    pieces = body.cuts[cut]
    starts = dict(zip(map(id, pieces), np.cumsum([0.0, *(p.length for p in pieces)]), strict=False))
    arcs, points, normals = [np.zeros(0)], [np.zeros((0, 2))], [np.zeros((0, 2))]
    for part in body.parts:
        if part.cut != cut:
            continue
        t = part.start + (part.end - part.start) * _towards_ends()
        arcs.append(starts[id(part.piece)] + t * part.piece.length)
        points.append(part.piece.point(t))
        normals.append(part.piece.facing(points[-1]))
    arc = np.concatenate(arcs)
    order = np.argsort(arc, kind="stable")
    return _line(body, cut, "arc length along the cut", arc[order],
                 np.concatenate(points)[order], np.concatenate(normals)[order])  # fmt: skip


def _on_surface(body: SolidBody, cut: str) -> ProfileLine:
    patches = body.cuts[cut]
    where, parameters = _line_of(patches)
    points = np.concatenate([p.point(uv) for p, uv in zip(patches, parameters, strict=True)])
    normals = np.concatenate([p.normal(uv) for p, uv in zip(patches, parameters, strict=True)])
    inside = body.inside(points)
    points, normals = points[inside], normals[inside]
    return _line(body, cut, where, arc_lengths(points), points, normals)


def _line_of(patches: Sequence[Patch]) -> tuple[str, list[Array]]:
    """Say which line it is, and its parameters (n, 2) on each patch."""
    share = _towards_ends()
    first = patches[0]
    zero = np.zeros(len(share))
    if isinstance(first, DiscPatch):
        ways = 2 * share - 1
        turned = np.where(ways < 0.0, np.pi, 0.0)
        if first.semi_axes[1] > first.semi_axes[0]:
            turned += 0.5 * np.pi
        return "along the longer axis of the disc", [np.column_stack([np.abs(ways), turned])]
    if isinstance(first, CylinderPatch):
        half = np.full(len(share), 0.5 * first.height)
        return "along the arc at half the height", [np.column_stack([share, half])]
    if isinstance(first, SpherePatch):
        ways = (2 * share - 1) * first.opening
        turned = np.where(ways < 0.0, np.pi, zero)
        return "along a meridian", [np.column_stack([np.abs(ways), turned])]
    if len(patches) > 1:
        swept = [_half_way(p, share) for p in patches if isinstance(p, PlanePatch)]
        return "half-way along the swept line", swept
    return "along its longest direction, through its centroid", [_longest(first, share)]


def _half_way(patch: PlanePatch, share: Array) -> Array:
    """Draw a line between the middles of the two sides of a swept segment (a, b, b + along)."""
    a, b, c = patch.cells[0]
    return np.asarray(a + share[:, None] * (b - a) + 0.5 * (c - b))


def _longest(patch: PlanePatch, share: Array) -> Array:
    """Draw a line through the centroid of a polygon, as long as it stays inside."""
    edges = patch.cells[:, 1:] - patch.cells[:, :1]
    area = 0.5 * np.abs(determinants(edges))
    middle = np.average(patch.cells.mean(axis=1), axis=0, weights=area)
    triangles = patch.cells - middle
    whole = triangles.sum(axis=1)
    moment = np.einsum("m,mki,mkj->ij", area, triangles, triangles)
    moment += np.einsum("m,mi,mj->ij", area, whole, whole)  # second moment of area, times twelve
    corners, along = triangles.reshape(-1, 2), np.linalg.eigh(moment)[1][:, -1]
    reach = np.abs(corners @ along).max()
    s = np.linspace(-reach, reach, _FINE)
    on = ~patch.nearest(patch.point(middle + s[:, None] * along))[1]
    low, high = s[on].min(), s[on].max()
    uv = middle + (low + share * (high - low))[:, None] * along
    return np.asarray(uv[~patch.nearest(patch.point(uv))[1]])


def _on_membrane(body: MembraneBody, cut: str) -> ProfileLine:
    """Take the middles of the pieces of a cut, in order along its longest direction."""
    lines = body.lines[cut]
    middle = lines.ends.mean(axis=1)
    along = np.linalg.svd(lines.ends.reshape(-1, 3) - middle.mean(axis=0))[2][0]
    order = np.argsort(middle @ along, kind="stable")
    length = lines.lengths[order]
    arc = np.cumsum(length) - 0.5 * length
    kept = slice(None, None, max(1, len(order) // _PIECES))
    order, arc = order[kept], arc[kept]
    points, away = middle[order], AWAY * body.size
    rule = CutRule(
        points, np.ones(len(points)), lines.normals[order],
        points + away * lines.positive[order], points + away * lines.negative[order],
    )  # fmt: skip
    return ProfileLine(cut, "arc length along the cut", arc, rule)


def _line(
    body: AnyBody, cut: str, where: str, arc: Array, points: Array, normals: Array
) -> ProfileLine:
    rule = CutRule.beside(points, np.ones(len(points)), normals, AWAY * body.size)
    return ProfileLine(cut, where, arc, rule)


def _towards_ends() -> Array:
    """Choose shares (n,) of a line, inside its ends."""
    return 0.5 * (1.0 - np.cos(np.pi * (np.arange(_POINTS) + 0.5) / _POINTS))
