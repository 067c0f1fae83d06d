"""Opening of a cut at a point of it."""

import numpy as np

from verify.compare.body import Body
from verify.compare.cut_line import place_on_cut
from verify.compare.jump_error import displacement_jump
from verify.compare.locate import Field

__all__ = ["opening"]


def opening(field: Field, body: Body, cut: str, fraction: float, component: str) -> float:
    """Jump in m at a fraction of a cut's length, along its normal or its tangent.

    The normal points into the positive side, the tangent along the cut's direction.
    """
    place = place_on_cut(body, cut, fraction)
    normal = place.normals[0]
    direction = normal if component == "normal" else np.array([normal[1], -normal[0]])
    return float(displacement_jump(field, place)[0] @ direction)
