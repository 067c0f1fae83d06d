"""A penny-shaped crack in infinite space under tension (Sneddon)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.plane_cut import axes_of
from reference.exact.solution import Array, ExactSolution

__all__ = ["Penny"]


class _Derivatives(NamedTuple):
    """Derivatives (n,) of the harmonic function f at z ≥ 0, those by r over r where odd in r."""

    z: Array
    r_r: Array  # f_r / r
    zz: Array
    rz_r: Array  # f_rz / r
    zzz: Array
    zzr_r: Array  # f_zzr / r


class Penny(ExactSolution):
    """A circular crack of radius a whose faces are free, in a body under remote tension.

    The field of a pressure p on the faces (I. N. Sneddon, Proc. R. Soc. Lond. A 187, 1946) plus
    uniaxial tension p across the crack. Around the axis, with z along it,
    2μ u_r = B [(1−2ν) f_r + z f_rz], 2μ u_z = B [−2(1−ν) f_z + z f_zz], B = 2pa²/3π. The function
    f is harmonic; in oblate coordinates z = aζm, r² = a²(1+ζ²)(1−m²) its derivatives are
    elementary, with r² + (z+ia)² = R², R = a(ζ+im).

    Parameters ``centre`` (m, default the origin), ``normal`` of the crack (default z), radius
    ``a`` (m) and ``tension`` p (Pa).
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._centre = parameters.take("centre", (3,), default=np.zeros(3))
        if parameters.has("normal"):
            self._axes = axes_of(parameters)
        else:
            self._axes = np.eye(3)
        self._a = parameters.positive("a")
        self._tension = float(parameters.take("tension", ()))
        self._ratio = law.lame / (2 * (law.lame + law.shear))  # ν
        self._young = 2 * law.shear * (1 + self._ratio)
        self._scale = 2 * self._tension * self._a**2 / (3 * np.pi) / (2 * law.shear)

    @property
    def stress_intensity(self) -> float:
        """K_I, the same along the whole front, Pa·√m."""
        return float(2 * self._tension * np.sqrt(self._a / np.pi))

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 3), m; see `ExactSolution`."""
        s, z, upper, f = self._evaluate(points, near)
        with np.errstate(invalid="ignore"):  # z f_rz is 0 · ∞ at the front, and 0 there
            spread = self._scale * ((1 - 2 * self._ratio) * f.r_r + _times(z, f.rz_r))
            rise = self._scale * (-2 * (1 - self._ratio) * f.z + _times(z, f.zz))
        strain = self._tension / self._young
        spread -= self._ratio * strain
        across = upper * (rise + strain * z)
        return np.column_stack([spread * s[:, 0], spread * s[:, 1], across]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 3, 3), nan at the front. See `ExactSolution`."""
        s, z, upper, f = self._evaluate(points, near)
        nu, scale, strain = self._ratio, self._scale, self._tension / self._young
        x, y = s[:, 0], s[:, 1]
        square = x**2 + y**2
        # on the axis 0/0, and at the front ∞ − ∞: the limit depends on the way there
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = scale * ((1 - 2 * nu) * f.r_r + z * f.rz_r) - nu * strain
            # (1/r) ∂_r of f_r/r and f_rz/r, by harmonicity: f_rr = −f_r/r − f_zz, and so for f_z
            bend = ((1 - 2 * nu) * (-2 * f.r_r - f.zz) + z * (-2 * f.rz_r - f.zzz)) / square
            bend = np.where(square > 0.0, scale * bend, 0.0)
            by_z = scale * ((1 - 2 * nu) * f.rz_r + f.rz_r + z * f.zzr_r) * upper
            rise_r = scale * (-2 * (1 - nu) * f.rz_r + z * f.zzr_r) * upper
            rise_z = scale * (-2 * (1 - nu) * f.zz + f.zz + z * f.zzz) + strain
            gradient = np.empty((len(s), 3, 3))
            gradient[:, 0] = np.column_stack([spread + bend * x * x, bend * x * y, by_z * x])
            gradient[:, 1] = np.column_stack([bend * x * y, spread + bend * y * y, by_z * y])
            gradient[:, 2] = np.column_stack([rise_r * x, rise_r * y, rise_z])
            turned: Array = self._axes.T @ gradient @ self._axes
        return turned

    def _evaluate(
        self, points: Array, near: Array | None
    ) -> tuple[Array, Array, Array, _Derivatives]:
        """Local points, |z|, the sign of the side, and the derivatives of f."""
        s = (np.asarray(points, dtype=float) - self._centre) @ self._axes.T
        side = s[:, 2]
        if near is not None:
            beside = (np.asarray(near, dtype=float) - self._centre) @ self._axes[2]
            # a point of the faces, up to round-off, is on the side of its `near`
            on_faces = np.abs(side) <= 1e-9 * self._a
            side = np.where(on_faces, beside, side)
        upper = np.where(side >= 0.0, 1.0, -1.0)
        z = np.maximum(upper * s[:, 2], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return s, z, upper, self._derivatives(np.hypot(s[:, 0], s[:, 1]), z)

    def _derivatives(self, r: Array, z: Array) -> _Derivatives:
        a = self._a
        q = (r - a) * (r + a) + z**2
        d = np.hypot(q, 2 * a * z)
        # the larger of ζ and m from its square, the other from z = aζm: no digits are lost
        large = np.sqrt(0.5 * (d + np.abs(q))) / a
        small = np.divide(z, a * large, out=np.zeros_like(z), where=large > 0)
        zeta, m = np.where(q >= 0, large, small), np.where(q >= 0, small, large)
        angle = np.arctan2(1.0, zeta)
        root = a * (zeta + 1j * m)
        inverse = 1.0 / root
        cubed = inverse**3
        spread = zeta**2 + m**2
        rz_r = 3 * m / (a**3 * (1 + zeta**2) * spread)
        return _Derivatives(
            -(3 * m / a) * (1 - zeta * angle),
            -(1.5 / a**2) * (angle - zeta / (1 + zeta**2)),
            (3 / a**2) * (angle - a * inverse.real),
            rz_r,
            (3 / a**2) * (inverse.imag + a * ((z + 1j * a) * cubed).real),
            (3 / a**2) * (-zeta / (a**2 * spread * (1 + zeta**2)) + a * cubed.real),
        )


def _times(z: Array, values: NDArray[np.float64]) -> Array:
    """Multiply; 0 where z is."""
    return np.where(z > 0.0, z * values, 0.0)
