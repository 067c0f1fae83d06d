"""Exact displacement fields with a traction-free cut, evaluated side by side.

Closed forms of the reference-case catalogue (families F1 and F3), E = 1, ν = 0.3. Written here
from the formulas, independently of the solver and of the framework's own exact solutions.
"""

import numpy as np

YOUNG, POISSON = 1.0, 0.3
MU = YOUNG / (2.0 * (1.0 + POISSON))
LAMBDA = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
ETA = LAMBDA / (LAMBDA + 2.0 * MU)

ALONG = np.array([3.0, 1.0]) / np.sqrt(10.0)
ACROSS = np.array([-1.0, 3.0]) / np.sqrt(10.0)

NORMAL = np.array([-1.0, -2.0, 3.0]) / np.sqrt(14.0)
FIRST = np.array([2.0, -1.0, 0.0]) / np.sqrt(5.0)
SECOND = np.cross(NORMAL, FIRST)

ENERGY_F3 = 2.7789417971


def _above(sides):
    return sides[:, 0] > 0


def f1_3d(points, sides):
    """Uniform stretch in the plane of the cut, another one on each side."""
    local = points - 0.5
    s1, s2, t = local @ FIRST, local @ SECOND, local @ NORMAL
    e1 = np.where(_above(sides), 0.1, -0.05)
    e2 = np.where(_above(sides), -0.03, 0.02)
    shift = np.where(_above(sides), 0.0, -0.02)
    across = shift - ETA * (e1 + e2) * t
    return (e1 * s1)[:, None] * FIRST + (e2 * s2)[:, None] * SECOND + across[:, None] * NORMAL


def f3(points, sides):
    """Airy function cos(ks)[C(t ch − sh/k) + D t sh] on each side, no body force."""
    local = points - 0.5
    s, t = local @ ALONG, local @ ACROSS
    up = _above(sides)
    C, D, k = np.where(up, 0.1, -0.2), np.where(up, 0.2, 0.1), np.where(up, 2.0, 3.0)
    ch, sh = np.cosh(k * t), np.sinh(k * t)
    both = LAMBDA + MU
    u_s = C * (k * both * t * ch + MU * sh) + D * (k * both * t * sh + (LAMBDA + 2 * MU) * ch)
    u_t = C * (k * both * t * sh - (LAMBDA + 2 * MU) * ch) + D * (k * both * t * ch - MU * sh)
    u_s, u_t = np.sin(k * s) * u_s / (2 * MU * both), -np.cos(k * s) * u_t / (2 * MU * both)
    return u_s[:, None] * ALONG + u_t[:, None] * ACROSS
