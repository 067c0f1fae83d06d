"""Quantities at a point: displacement of the body, opening of a cut."""

from collections.abc import Sequence

import numpy as np

from verify.compare.body import AnyBody, Body
from verify.compare.cut_line import CutRule, nearest_on_membrane_cut, place_on_cut
from verify.compare.error_norm import displacement_jump
from verify.compare.locate import Field
from verify.compare.membrane_body import MembraneBody
from verify.compare.surface_rule import nearest_on_cut


def opening(
    field: Field, body: AnyBody, cut: str, place: float | Sequence[float], component: str
) -> float:
    """Jump in m at a place of a cut, along its normal or its tangent.

    In the plane the place is a fraction of the cut's length, and the tangent goes along the
    cut's direction; in space the place is a point, of which the nearest on the cut is taken,
    and the tangential jump is the length of what is left of the jump without its normal part.
    The normal points into the positive side; of a membrane it lies in the surface.
    """
    at = cut_place(body, cut, place)
    normal, jump = at.normals[0], displacement_jump(field, at)[0]
    if component == "normal":
        return float(jump @ normal)
    if body.dimension == 2:
        return float(jump @ np.array([normal[1], -normal[0]]))
    return float(np.linalg.norm(jump - (jump @ normal) * normal))


def cut_place(body: AnyBody, cut: str, place: float | Sequence[float]) -> CutRule:
    """Take the point of a cut where an opening is asked for, as a rule of weight 1."""
    if isinstance(body, Body):
        assert isinstance(place, float)
        return place_on_cut(body, cut, place)
    point = np.array(place, dtype=float)
    if isinstance(body, MembraneBody):
        return nearest_on_membrane_cut(body, cut, point)
    return nearest_on_cut(body, cut, point)


def point_displacement(field: Field, point: Sequence[float], component: str) -> float:
    """Displacement in m of `point` in direction ``x``, ``y`` or ``z``."""
    at = np.array([point], dtype=float)
    return float(field.displacement(at, at)[0, "xyz".index(component)])
