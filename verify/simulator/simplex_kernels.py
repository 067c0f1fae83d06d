"""Distance of a point from a box, and volumes of simplices."""

from numba import njit

__all__ = ["box_gap", "signed_volume"]


@njit(cache=True)
def box_gap(x, low, high):
    """Squared distance of a point from a box, zero inside."""
    total = 0.0
    for i in range(len(x)):
        gap = max(low[i] - x[i], 0.0, x[i] - high[i])
        total += gap * gap
    return total


@njit(cache=True)
def signed_volume(corners):
    """Give d! times the signed volume of a triangle (3, 2) or tetrahedron (4, 3)."""
    a = corners[0]
    if corners.shape[1] == 2:
        return (corners[1, 0] - a[0]) * (corners[2, 1] - a[1]) - (corners[1, 1] - a[1]) * (
            corners[2, 0] - a[0]
        )
    total = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        cross = (corners[2, j] - a[j]) * (corners[3, k] - a[k]) - (corners[2, k] - a[k]) * (
            corners[3, j] - a[j]
        )
        total += (corners[1, i] - a[i]) * cross
    return total
