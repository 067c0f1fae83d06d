"""Places in the memory in which eight tetrahedra are computed with at once.

They count entries of `LANES` numbers. The first fifteen are of the rotations: the deformation
gradient by rows, the quaternion from `TURNED` on, and what `turn_lanes` needs besides.
"""

from numba import njit

from verify.xfem.lanes.vectors import LANES

__all__ = [
    "BLOCKS",
    "CORNERS",
    "ENTRIES",
    "FIRST",
    "FORCE",
    "GRADIENTS",
    "IRREGULAR",
    "MODULI",
    "MOVED",
    "TURNED",
    "matrix_at",
    "rotation_at",
]

TURNED = 9  # quaternion
IRREGULAR = 13  # not zero: what is sought has no plain form
MOVED = 15  # deformation gradient of what is moved, or of the start of a step
GRADIENTS = 24  # b_1, b_2, b_3
MODULI = 33  # w λ and w μ
FORCE = 35
BLOCKS = 47
CORNERS = 101  # displacement and what is moved, of four corners
FIRST = 125  # quaternion at the start of a step
ENTRIES = 129


@njit(cache=True, inline="always")
def matrix_at(v, entry, l):
    """Nine numbers of a lane, by rows."""
    at = entry * LANES + l
    return (
        v[at], v[at + LANES], v[at + 2 * LANES],
        v[at + 3 * LANES], v[at + 4 * LANES], v[at + 5 * LANES],
        v[at + 6 * LANES], v[at + 7 * LANES], v[at + 8 * LANES],
    )  # fmt: skip


@njit(cache=True, inline="always")
def rotation_at(v, entry, l):
    """Matrix of a quaternion of a lane, by rows."""
    at = entry * LANES + l
    w, x, y, z = v[at], v[at + LANES], v[at + 2 * LANES], v[at + 3 * LANES]
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip
