"""Motions known exactly: a blade through a prestretched strip, a bar let go, a sudden crack."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference.exact.solution import Array, ExactSolution, Hooke, Parameters, Plane
from verify.errors import InputError

Complex = NDArray[np.complex128]


class BladeStrip(ExactSolution):
    """Antiplane motion of a strip |y| < b with edges gripped at u_z = ±w₀, cut along y = 0.

    In the axes of the strip, with g = √(1 − v²/c²) and s = exp(π (x − vt)/(2bg) + iπ|y|/(2b)),

        u_z = sign(y) w₀ [1 − (2/π) Re arcsin s],

    the steady state behind a tip that is at x = vt and advances at v < c = √(μ/ρ). Faces are free
    of traction, far behind the halves are at rest at ±w₀. Any part of the strip is a body that
    it solves. At v = 0 it is the strip with a crack at rest.

    Parameters: ``half_width`` b (m); ``grip`` w₀ (m); ``speed`` v (m/s, default 0); ``tip`` (x, y)
    at the time 0 (m, default the origin); ``angle`` of the advance (degrees, default 0). A speed
    needs the density of the material.
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

    @property
    def stress_intensity(self) -> tuple[float, float, float]:
        """K_I, K_II and K_III = μ w₀ √(2g/b), Pa·√m."""
        return 0.0, 0.0, float(self.law.shear * self._w * np.sqrt(2 * self._g / self._b))

    @property
    def energy_release_rate(self) -> float:
        """Return G = K_III²/(2μg) = μ w₀²/b, J/m² of new cut, whatever the speed."""
        return float(self.law.shear * self._w**2 / self._b)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 3), m; see `ExactSolution`."""
        s, sign, _ = self._evaluate(points, near)
        u = np.zeros((len(s), 3))
        u[:, 2] = sign * self._w * (1.0 - 2.0 / np.pi * np.arcsin(s).real)
        return u

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 3, 3), infinite at the tip. See `ExactSolution`."""
        s, sign, mirror = self._evaluate(points, near)
        slope = self._slope(s)
        gradient = np.zeros((len(s), 3, 3))
        along = sign * slope.real / self._g
        across = -sign * mirror * slope.imag
        gradient[:, 2, :2] = np.column_stack([along, across]) @ self._axes
        return gradient

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Compute the velocity (n, 3), m/s; see `ExactSolution`."""
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
        """Give s (n,), the sign of the side, and the sign of dy in d|y|.

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
        """Find the places ahead of the tip and across the cut, m."""
        x, y = (
            column - at for column, at in zip(np.asarray(points, float).T, self._tip, strict=False)
        )
        ahead, across = (row[0] * x + row[1] * y for row in self._axes)
        return ahead - self._v * self.time, across


class ReleasedBar(ExactSolution):
    """Uniaxial strain of a bar between held ends, let go across at the time 0: d'Alembert's waves.

    Until then u_x = ε (x − x₀). Then both faces of the cut, or the end that was pulled, are free of
    traction. Waves run at c = √((λ+2μ)/ρ), without lateral contraction: the sides are held or
    Poisson's ratio is zero. See `wave`.

    Parameters ``strain`` ε, ``ends`` of the bar along x (m), ``at``, where it is let go (m):
    between the ends, or one of them, and ``origin`` x₀ (m, default 0). The material needs a
    density.
    """

    moves = True

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._strain = float(parameters.take("strain", ()))
        self._ends = parameters.take("ends", (2,))
        self._at = float(parameters.take("at", ()))
        self._origin = float(parameters.take("origin", (), default=0.0))
        if parameters.has("ends"):
            if not self._ends[0] < self._ends[1]:
                raise InputError(f"parameters.ends = {list(self._ends)}; expected two that ascend")
            if not self._ends[0] <= self._at <= self._ends[1]:
                raise InputError(f"parameters.at = {self._at:g}; expected between the ends")
        if law.density is None:
            raise InputError("a bar in motion needs the density of the material")
        self._speed = float(np.sqrt((law.lame + 2 * law.shear) / law.density))

    @property
    def cut_plane(self) -> Plane | None:
        """Where the bar is let go across, unless at an end."""
        axis = np.eye(self.dimension)[0]
        if self._at in self._ends:
            return None
        return self._at * axis, axis

    def smooth(self, points: Array, reach: Array | float) -> NDArray[np.bool_]:
        """Tell whether no front of a wave is within a distance of points; see `ExactField`."""
        _, far, length = self._local(points, None)
        run = self._speed * self.time
        front = length - np.abs(run % (2 * length) - length)
        return np.asarray(np.abs(far - front) > reach)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d), m; see `ExactSolution`."""
        side, far, length = self._local(points, near)
        start = np.asarray(points)[:, 0] - self._origin
        return self._along(start + side * wave(far, length, self._speed * self.time)[0])

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute displacement gradient (n, d, d), which jumps at fronts. See `ExactSolution`."""
        _, far, length = self._local(points, near)
        slope = 1.0 + wave(far, length, self._speed * self.time)[1]
        return self._along(slope)[:, :, None] * np.eye(self.dimension)[0]

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Compute the velocity (n, d), m/s; see `ExactSolution`."""
        side, far, length = self._local(points, near)
        return self._along(side * self._speed * wave(far, length, self._speed * self.time)[2])

    def _along(self, values: Array) -> Array:
        """Compute vectors (n, d) along the bar, of values (n,) per strain."""
        return self._strain * values[:, None] * np.eye(self.dimension)[0]

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Array, Array]:
        """Side (n,) of the release, 1 or −1, distance from it, and length of that part, m."""
        x = np.asarray(points, dtype=float)[:, 0]
        decides = (x if near is None else np.asarray(near)[:, 0]) - self._at
        above = (decides >= 0.0) & (self._at < self._ends[1]) | (self._at <= self._ends[0])
        side = np.where(above, 1.0, -1.0)
        length = np.where(above, self._ends[1] - self._at, self._at - self._ends[0])
        return side, side * (x - self._at), length


class Impact(ExactSolution):
    """Two equal halves of a bar that move towards each other and touch: d'Alembert's waves.

    Let y be the distance from the place where they meet and τ the time since. The halves move by
    −(v/c) min(y, m) towards it, m = L − |cτ − L|. They are together for 2L/c, under the pressure
    ρcv, then apart with velocities exchanged. c = √((λ+2μ)/ρ), as of `ReleasedBar`.

    Parameters: ``half_length`` L (m); ``at``, where they meet along the ``axis`` (m, default x);
    ``speed`` v of each (m/s); the ``gap`` between them at the time 0 (m, default 0). The material
    needs a density.
    """

    moves = True

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._length = parameters.positive("half_length")
        along = parameters.take("axis", (self.dimension,), default=np.eye(self.dimension)[0])
        if not along.any():
            raise InputError("parameters.axis is zero; expected a direction")
        self._axis = along / np.linalg.norm(along)
        self._at = float(parameters.take("at", ()))
        self._v = parameters.positive("speed")
        self._gap = float(parameters.take("gap", (), default=0.0))
        if law.density is None or self._gap < 0.0:
            raise InputError("an impact needs the density of the material, and a gap of 0 or more")
        self._speed = float(np.sqrt((law.lame + 2 * law.shear) / law.density))

    @property
    def cut_plane(self) -> Plane:
        """Where the halves meet."""
        return self._at * self._axis, self._axis

    def smooth(self, points: Array, reach: Array | float) -> NDArray[np.bool_]:
        """Tell whether no front of a wave is within a distance of points; see `ExactField`."""
        _, far = self._local(points, None)
        return np.asarray(np.abs(far - self._front()[0]) > reach)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d), m; see `ExactSolution`."""
        side, far = self._local(points, near)
        way = -self._v / self._speed * np.where(self._ahead(far), self._front()[0], far)
        return (side * way)[:, None] * self._axis

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute displacement gradient (n, d, d), which jumps at fronts. See `ExactSolution`."""
        strain = -self._v / self._speed * ~self._ahead(self._local(points, near)[1])
        return np.asarray(strain[:, None, None] * np.outer(self._axis, self._axis))

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Compute the velocity (n, d), m/s; see `ExactSolution`."""
        side, far = self._local(points, near)
        rate = -self._v * self._front()[1] * self._ahead(far)
        return (side * rate)[:, None] * self._axis

    def _front(self) -> tuple[float, float]:
        """Distance m of the front of the wave from the meeting place, m, and its direction."""
        run = self._speed * (self.time - 0.5 * self._gap / self._v)
        return self._length - abs(run - self._length), 1.0 if run < self._length else -1.0

    def _ahead(self, far: Array) -> NDArray[np.bool_]:
        """Tell which points (n,) no wave has reached: all of halves that are apart.

        A point on the front counts as ahead, in spite of round-off: a free end has no stress.
        """
        front = self._front()[0]
        return np.asarray((far > front - 1e-12 * self._length) | (front <= 0.0))

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Array]:
        """Compute the side (n,) of the meeting place, 1 or −1, and distance from it, m."""
        x = np.asarray(points, dtype=float) @ self._axis
        decides = x if near is None else np.asarray(near) @ self._axis
        side = np.where(decides >= self._at, 1.0, -1.0)
        return side, side * (x - self._at)


def wave(distance: ArrayLike, length: ArrayLike, run: float) -> tuple[Array, Array, Array]:
    """Displacement (m), slope and rate per strain of a bar whose free end is loaded suddenly.

    d'Alembert's sum over reflections; the stress at the end corresponds to the strain. The slope
    is by the distance from the end, the rate by the way that the wave has run.

    Parameters
    ----------
    distance : array
        From the loaded end, m; the other end is held.
    length : array
        Of the bar, m.
    run : float
        Way that a wave has run since, c t, m.
    """
    distance, length = np.broadcast_arrays(np.asarray(distance, float), np.asarray(length, float))
    if run == 0.0:  # no wave has begun: nor beyond the end, where cut cells have unknowns
        distance = np.abs(distance)
    found, slope, rate = np.zeros((3, *distance.shape))
    just = -1e-12 * length  # behind the front, in spite of round-off
    sign, way = 1.0, np.zeros(distance.shape)
    while (way <= run).any():
        out, back = run - way - distance, run - way - 2 * length + distance
        found += sign * (np.maximum(out, 0.0) - np.maximum(back, 0.0))
        slope -= sign * ((out >= just).astype(float) + (back >= just))
        rate += sign * ((out >= just).astype(float) - (back >= just))
        sign, way = -sign, way + 2 * length
    return found, slope, rate


def sudden_intensity(
    mode: Literal["I", "II", "III"], traction: float, law: Hooke, time: float
) -> float:
    """Stress-intensity factor, Pa √m, of a half-infinite crack with a traction from the time 0 on.

    Laplace transforms in time (s) and along the crack (sζ) leave one Wiener–Hopf equation for the
    stress ahead and the displacement behind. It is Σ₊ + Σ₋ ∝ F₊F₋ U₋, with the slownesses a and b
    of pressure and shear waves. A traction σ from the time 0 on gives K = 2σ√(2t/π)/F₊(0).
    Rayleigh's function, b⁴ at ζ = 0, and √a, √b of the displacement's own wave make

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
    """Compute the displacement jump along the front at a distance behind it, m: antiplane.

    The velocity of a face is (τc/μ) [1 − (2/π) arctan √(ct/r − 1)], c the speed of shear waves. The
    pole ζ = 0 is the plane wave, the branch cut from b on the wave from the tip.

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
