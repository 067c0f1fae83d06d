"""Cracks in motion: a blade through a prestretched strip, and a crack that is loaded suddenly."""

from copy import copy
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from reference.exact.field import Hooke, Parameters
from reference.exact.solution import Array, ExactSolution
from verify.errors import InputError
from verify.scene import Scene

Complex = NDArray[np.complex128]


class BladeStrip(ExactSolution):
    """Antiplane motion of a strip |y| < b with edges gripped at u_z = ±w₀, cut along y = 0.

    In the axes of the strip, with g = √(1 − v²/c²) and s = exp(π (x − vt)/(2bg) + iπ|y|/(2b)),

        u_z = sign(y) w₀ [1 − (2/π) Re arcsin s],

    the steady state behind a tip that is at x = vt and advances at v < c = √(μ/ρ). Faces are free
    of traction, far behind the halves are at rest at ±w₀. Any part of the strip is a body that
    it solves. At v = 0 it is the strip with a crack at rest.

    Parameters ``half_width`` b (m), ``grip`` w₀ (m), ``speed`` v (m/s, default 0), ``tip`` (x, y)
    at the time 0 (m, default the origin) and ``angle`` of the direction of the advance (degrees,
    default 0). A speed needs the density of the material.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._b, self._w = parameters.positive("half_width"), parameters.positive("grip")
        self._v = float(parameters.take("speed", (), default=0.0))
        self._tip = parameters.take("tip", (2,), default=(0.0, 0.0))
        angle = np.deg2rad(float(parameters.take("angle", (), default=0.0)))
        self._axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        if self._v and law.density is None:
            raise InputError("parameters.speed needs the density of the material")
        wave = float(np.sqrt(law.shear / (law.density or law.shear)))
        if not 0.0 <= self._v < wave:
            raise InputError(
                f"parameters.speed = {self._v:g}; expected at least 0 and below that of shear "
                f"waves, {wave:.6g} m/s"
            )
        self._g = float(np.sqrt(1.0 - (self._v / wave) ** 2))
        self.moves = self._v > 0.0
        self.time = 0.0

    def at(self, time: float) -> Self:
        """Return the field at a time, s."""
        other = copy(self)
        other.time = float(time)
        return other

    @property
    def stress_intensity(self) -> tuple[float, float, float]:
        """K_I, K_II and K_III = μ w₀ √(2g/b), Pa·√m."""
        return 0.0, 0.0, float(self.law.shear * self._w * np.sqrt(2 * self._g / self._b))

    @property
    def energy_release_rate(self) -> float:
        """Return G = K_III²/(2μg) = μ w₀²/b, J/m² of new cut, whatever the speed."""
        return float(self.law.shear * self._w**2 / self._b)

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a body around the strip at rest, J; see `ExactSolution`.

        Raises
        ------
        InputError
            If the field moves: the tractions on the surface do not say it.
        """
        if self.moves:
            raise InputError("the strain energy of a moving field is no work on the surface")
        return super().strain_energy(body)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 3), m; see `ExactSolution`."""
        s, sign, _ = self._evaluate(points, near)
        u = np.zeros((len(s), 3))
        u[:, 2] = sign * self._w * (1.0 - 2.0 / np.pi * np.arcsin(s).real)
        return u

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 3, 3), infinite at the tip. See `ExactSolution`."""
        s, sign, mirror = self._evaluate(points, near)
        slope = self._slope(s)
        gradient = np.zeros((len(s), 3, 3))
        along = sign * slope.real / self._g
        across = -sign * mirror * slope.imag
        gradient[:, 2, :2] = np.column_stack([along, across]) @ self._axes
        return gradient

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Velocity (n, 3), m/s; see `ExactSolution`."""
        s, sign, _ = self._evaluate(points, near)
        v = np.zeros((len(s), 3))
        if self._v:
            v[:, 2] = -self._v * sign * self._slope(s).real / self._g
        return v

    def _slope(self, s: Complex) -> Complex:
        """Return the derivative of w₀ (1 − (2/π) arcsin s) by (x − vt)/g + i|y|."""
        with np.errstate(divide="ignore", invalid="ignore"):
            # √(1 − s²) on the branch of arcsin
            root = np.sqrt(1.0 - s) * np.sqrt(1.0 + s)
            large = np.isinf(s)
            slope = -self._w / self._b * np.where(large, 1j, s / root)
        return np.asarray(slope)

    def _evaluate(self, points: Array, near: Array | None) -> tuple[Complex, Array, Array]:
        """Give s (n,), the sign of the side, and that of dy in d|y|.

        Behind the tip a point belongs to the side of its `near`, and the field of a side goes on
        evenly beyond the cut; ahead nothing is cut.
        """
        x, y = self._local(points)
        sign = np.where(y < 0.0, -1.0, 1.0)
        mirror = sign.copy()
        if near is not None:
            behind = x < 0.0
            sign = np.where(behind, np.where(self._local(near)[1] < 0.0, -1.0, 1.0), sign)
            mirror = np.where(y == 0.0, sign, mirror)
        phase = 0.5 * np.pi / self._b
        with np.errstate(over="ignore"):
            size = np.exp(np.minimum(phase * x / self._g, 700.0))
        s = np.empty(len(x), dtype=complex)
        s.real, s.imag = size * np.cos(phase * np.abs(y)), size * np.sin(phase * np.abs(y))
        return s, sign, mirror

    def _local(self, points: Array) -> tuple[Array, Array]:
        """Places ahead of the tip and across the cut, m."""
        x, y = ((np.asarray(points, dtype=float)[:, :2] - self._tip) @ self._axes.T).T
        return x - self._v * self.time, y


def sudden_intensity(
    mode: Literal["I", "II", "III"], traction: float, law: Hooke, time: float
) -> float:
    """Stress-intensity factor, Pa √m, of a half-infinite crack with a traction from the time 0 on.

    Laplace transforms in time (s) and along the crack (sζ) leave one equation of Wiener–Hopf for
    the stress ahead and the displacement behind, Σ₊ + Σ₋ ∝ F₊F₋ U₋, with the slownesses a and b of
    pressure and shear waves. A traction σ from the time 0 on gives K = 2σ√(2t/π)/F₊(0), where the
    function of Rayleigh, b⁴ at ζ = 0, and √a, √b of the displacement's own wave make

        F₊(0)² = b⁴/(2a(b² − a²)) in mode I, b⁴/(2b(b² − a²)) in mode II, b in mode III.

    L. B. Freund, Dynamic Fracture Mechanics (1990), sections 2.3 to 2.5. It holds at a tip until a
    wave has come back to it. In plane stress it holds with the Lamé constant of the plane law.

    Parameters
    ----------
    mode : {"I", "II", "III"}
        Of the traction: pressure, shear across the front, shear along it.
    traction : float
        Pa.
    law : Hooke
    time : float
        s.

    Raises
    ------
    InputError
        If the law has no density.
    """
    shear_wave = _shear_wave(law)
    k = law.shear / (law.lame + 2 * law.shear)  # (c_s/c_d)²
    squared = {
        "I": 2 * np.sqrt(k) * (1 - k),  # c_s t times this: with c_d = c_s/√k
        "II": 2 * (1 - k),
        "III": 1.0,
    }[mode]
    return float(2 * traction * np.sqrt(2 * squared * shear_wave * time / np.pi))


def sudden_slip(traction: float, law: Hooke, distance: float, time: float) -> float:
    """Displacement jump along the front at a distance behind it, m: antiplane.

    The velocity of a face is (τc/μ) [1 − (2/π) arctan √(ct/r − 1)], c that of shear waves: the
    pole ζ = 0 is the plane wave, the branch cut from b on what comes from the tip.

    Parameters
    ----------
    traction : float
        Shear along the front on each face, Pa.
    law : Hooke
    distance : float
        r, m.
    time : float
        s.

    Raises
    ------
    InputError
        If the law has no density.
    """
    way = _shear_wave(law) * time
    if way <= distance:
        return 2 * traction / law.shear * way
    reach = np.sqrt(distance * (way - distance))
    slip = way * np.arcsin(np.sqrt(distance / way)) + reach
    return float(4 * traction / (np.pi * law.shear) * slip)


def _shear_wave(law: Hooke) -> float:
    if law.density is None:
        raise InputError("a crack in motion needs the density of the material")
    return float(np.sqrt(law.shear / law.density))
