"""Nearest points of segments and triangles: the kernels under every distance of this package.

A facet is a (k, s) array of corners: k = 2 for a segment, k = 3 for a triangle, in s = 2 or 3
dimensions. Nearest points are given by barycentric weights that are *exactly* zero on corners that
do not take part, so that a caller can tell face, edge and vertex apart without a tolerance
(regions of a triangle: C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
"""

from numba import njit


@njit(cache=True)
def squared_distance(a, b):
    """Return |a − b|²."""
    total = 0.0
    for i in range(len(a)):
        total += (a[i] - b[i]) ** 2
    return total


@njit(cache=True)
def nearest_on_facet(x, corners, weights):
    """Write the weights (k,) of the point of a facet that is nearest to x."""
    for k in range(len(weights)):
        weights[k] = 0.0
    if corners.shape[0] == 2:
        p, q = 0.0, 0.0
        for i in range(len(x)):
            along = corners[1, i] - corners[0, i]
            p += (x[i] - corners[0, i]) * along
            q += along * along
        if p <= 0.0:
            weights[0] = 1.0
        elif p >= q:
            weights[1] = 1.0
        else:
            weights[1] = p / q
            weights[0] = 1.0 - weights[1]
        return
    ab, ac, ab2, ac2, abac = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        first, second = corners[1, i] - corners[0, i], corners[2, i] - corners[0, i]
        ab += (x[i] - corners[0, i]) * first
        ac += (x[i] - corners[0, i]) * second
        ab2 += first * first
        ac2 += second * second
        abac += first * second
    if ab <= 0.0 and ac <= 0.0:
        weights[0] = 1.0
        return
    b_ab, b_ac = ab - ab2, ac - abac
    if b_ab >= 0.0 and b_ac <= b_ab:
        weights[1] = 1.0
        return
    c_ab, c_ac = ab - abac, ac - ac2
    if c_ac >= 0.0 and c_ab <= c_ac:
        weights[2] = 1.0
        return
    on_c = ab * b_ac - b_ab * ac
    if on_c <= 0.0 and ab >= 0.0 and b_ab <= 0.0:
        weights[1] = ab / (ab - b_ab)
        weights[0] = 1.0 - weights[1]
        return
    on_b = c_ab * ac - ab * c_ac
    if on_b <= 0.0 and ac >= 0.0 and c_ac <= 0.0:
        weights[2] = ac / (ac - c_ac)
        weights[0] = 1.0 - weights[2]
        return
    on_a = b_ab * c_ac - c_ab * b_ac
    toward_c, toward_b = b_ac - b_ab, c_ab - c_ac
    if on_a <= 0.0 and toward_c >= 0.0 and toward_b >= 0.0:
        weights[2] = toward_c / (toward_c + toward_b)
        weights[1] = 1.0 - weights[2]
        return
    total = on_a + on_b + on_c
    weights[1] = on_b / total
    weights[2] = on_c / total
    weights[0] = 1.0 - weights[1] - weights[2]


@njit(cache=True)
def foot_on_facet(corners, weights, foot):
    """Write the point of a facet with these weights."""
    for i in range(len(foot)):
        foot[i] = 0.0
        for k in range(corners.shape[0]):
            foot[i] += weights[k] * corners[k, i]
