"""Fields without a tip, from uniform strains to waves: cut and uncut bodies reproduce them."""

import numpy as np

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution
from reference.exact.two_sided import Above, TwoSidedSolution, matrices, side


class Linear(ExactSolution):
    """u = G x + shift, uncut, with ``matrix`` G (d rows) and ``shift``; in the plane or in space.

    What an uncut body must reproduce to round-off.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        d = law.dimension
        self._matrix = parameters.take("matrix", (d, d))
        self._shift = parameters.take("shift", (d,), default=np.zeros(d))

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d), m."""
        return np.asarray(points, dtype=float) @ self._matrix.T + self._shift

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d)."""
        return np.broadcast_to(self._matrix, (len(points), *self._matrix.shape)).copy()


class Patch(TwoSidedSolution):
    """F1, uniform strain on each side: u_α = ε_α s_α, u_t = −η Σ ε_α t, plus shift.

    Free of traction at the cut. ``strain`` per side: ε, or in space a row (ε1, ε2).
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        along = parameters.take("strain", (2,) if law.dimension == 2 else (2, 2)).reshape(2, -1)
        self._strain = np.column_stack([along, -law.eta * along.sum(axis=1)])

    def _local_displacement(self, s: Array, above: Above) -> Array:
        return side(self._strain, above) * s

    def _local_gradient(self, s: Array, above: Above) -> Array:
        return side(self._strain, above)[:, :, None] * np.eye(self.dimension)


class Bending(TwoSidedSolution):
    """F2, pure bending: σ_ss = k t, u_s = k/E'·s t, u_t = −k/(2E')·(s² + η t²) + shift.

    Free of traction at the cut. ``stress_gradient`` k (Pa/m) and ``shift`` (m) per side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._curvature = parameters.take("stress_gradient", (2,)) / law.plane_modulus

    def _local_displacement(self, s: Array, above: Above) -> Array:
        (x, t), c = s.T, side(self._curvature, above)
        return np.column_stack([c * x * t, -0.5 * c * (x**2 + self.law.eta * t**2)])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        (x, t), c = s.T, side(self._curvature, above)
        return matrices([[c * t, c * x], [-c * x, -self.law.eta * c * t]])


class Airy(TwoSidedSolution):
    """F3, Airy stress function cos ks·[C (t cosh kt − sinh kt/k) + D t sinh kt] per side.

    Curved, without body force, free of traction at the cut. Parameters ``above`` and ``below``,
    each (C, D, k), and ``shift`` of u_t.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._rows = np.stack([parameters.take("above", (3,)), parameters.take("below", (3,))])

    def _local_displacement(self, s: Array, above: Above) -> Array:
        k, along, across, _, _ = self._profiles(s[:, 1], above)
        return np.column_stack([np.sin(k * s[:, 0]) * along, -np.cos(k * s[:, 0]) * across])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        k, along, across, along_t, across_t = self._profiles(s[:, 1], above)
        sin, cos = np.sin(k * s[:, 0]), np.cos(k * s[:, 0])
        return matrices([[k * cos * along, sin * along_t], [k * sin * across, -cos * across_t]])

    def _profiles(self, t: Array, above: Above) -> tuple[Array, Array, Array, Array, Array]:
        """Give k, the functions of t in u_s and u_t, and their derivatives."""
        lame, shear = self.law.lame, self.law.shear
        c, d, k = side(self._rows, above).T
        ch, sh, both, m = np.cosh(k * t), np.sinh(k * t), k * (lame + shear), lame + 2 * shear
        scale = 1.0 / (2 * shear * (lame + shear))
        along = c * (both * t * ch + shear * sh) + d * (both * t * sh + m * ch)
        across = c * (both * t * sh - m * ch) + d * (both * t * ch - shear * sh)
        rise, fall = both * (ch + k * t * sh), both * (sh + k * t * ch)
        along_t = c * (rise + shear * k * ch) + d * (fall + m * k * sh)
        across_t = c * (fall - m * k * sh) + d * (rise - shear * k * ch)
        return k, scale * along, scale * across, scale * along_t, scale * across_t


class Sinusoidal(TwoSidedSolution):
    """F4, waves along the cut: u_α = U_α − t ∂_α V, u_t = V − η t div U.

    With U_α and V = A sin(k·s + φ) on each side; free of traction at the cut, and kept in
    equilibrium by the body force −div σ. Parameters ``above`` and ``below``: rows (A, k, φ) of U_α
    and V, in space (A, k1, k2, φ), φ in degrees; and the ``shift``.
    """

    has_body_force = True

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        d = law.dimension
        self._rows = np.stack([parameters.take(part, (d, d + 1)) for part in ("above", "below")])
        self._rows[:, :, -1] = np.deg2rad(self._rows[:, :, -1])
        self._along, self._t = range(d - 1), d - 1  # U_α are the first functions, V is the last

    def _local_displacement(self, s: Array, above: Above) -> Array:
        t, wave = s[:, -1], self._wave
        along = [wave(s, above, a) - t * wave(s, above, self._t, a) for a in self._along]
        across = wave(s, above, self._t) - self.law.eta * t * self._divergence(s, above)
        return np.column_stack([*along, across])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        t, wave, eta = s[:, -1], self._wave, self.law.eta
        slopes = [wave(s, above, self._t, a) for a in self._along]
        rows = [
            [wave(s, above, a, b) - t * wave(s, above, self._t, a, b) for b in self._along]
            + [-slopes[a]]
            for a in self._along
        ]
        last = [slopes[a] - eta * t * self._divergence(s, above, a) for a in self._along]
        return matrices([*rows, [*last, -eta * self._divergence(s, above)]])

    def _local_body_force(self, s: Array, above: Above) -> Array:
        lame, shear, t = self.law.lame, self.law.shear, s[:, -1]
        m = lame + 2 * shear
        columns = []
        for a in self._along:
            force = -shear * self._laplacian(s, above, a)
            force -= 2 * shear * (lame + shear) / m * self._divergence(s, above, a)
            columns.append(force + m * t * self._laplacian(s, above, self._t, a))
        of_divergence = sum(self._divergence(s, above, b, b) for b in self._along)
        across = lame * self._laplacian(s, above, self._t) + lame * shear / m * t * of_divergence
        return np.column_stack([*columns, across])

    def _wave(self, s: Array, above: Above, which: int, *by: int) -> Array:
        """Give the derivative of U_α or V by the axes `by`, (n,)."""
        rows = side(self._rows[:, which], above)
        k = rows[:, 1:-1]
        angle = np.sum(k * s[:, :-1], axis=1) + rows[:, -1] + len(by) * np.pi / 2
        return np.asarray(rows[:, 0] * np.prod(k[:, list(by)], axis=1) * np.sin(angle))

    def _divergence(self, s: Array, above: Above, *by: int) -> Array:
        return np.sum([self._wave(s, above, a, a, *by) for a in self._along], axis=0)

    def _laplacian(self, s: Array, above: Above, which: int, *by: int) -> Array:
        return np.sum([self._wave(s, above, which, a, a, *by) for a in self._along], axis=0)
