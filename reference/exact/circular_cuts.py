"""Circular cuts: a crack along an arc, a disc or ball cut out, a penny-shaped crack."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact.solution import (
    Array,
    ExactSolution,
    Hooke,
    Parameters,
    box_of,
    complex_gradient,
    matrices,
    plane_axes,
    turned,
)
from verify.errors import InputError
from verify.geometry.simplices import unit_rule
from verify.scene import Scene

Complex = NDArray[np.complex128]
# Within this of the centre (over the radius) potentials are summed from their Taylor series,
# whose closed forms lose digits there like the inverse of the distance.
_NEAR_CENTRE = 0.2
_TERMS = 64
_POINTS, _WEIGHTS = unit_rule(40)
_AXIS = 1e-9  # of the radius: closer to the axis a point is on it


class _Potentials(NamedTuple):
    """Values (n,) of φ, φ', φ'', ψ and ψ'."""

    phi: Complex
    phi_1: Complex
    phi_2: Complex
    psi: Complex
    psi_1: Complex


class ArcCrack(ExactSolution):
    """Both faces free, from N. I. Muskhelishvili's linear relationship for circular arcs.

    Let z be over the radius and the crack go from e^{−iα} to e^{iα}. With c = cos α and X = √(z² −
    2cz + 1), X → z far away,

        φ  = ½ [(d − Ḡ/z) X − Ḡ/z + C z],
        ψ  = {½ [G z² − C̄ − (d̄ − G z) X] − φ'} / z,

    where Γ = (σ_xx + σ_yy)/4 and G = (σ_yy − σ_xx)/2 + iσ_xy of the remote stress in the axes of
    the arc. The constants are C = 2Γ − d, Re d = (4Γ + ½ sin²α Re G)/(3 − c); Im d = ½ sin²α Im
    G/(1 + c). The displacement is 2μ(u + iv) = κφ − z conj φ' − conj ψ. Under tension σ from all
    sides K_I = σ √(πR sin α) cos(α/2)/(1 + sin²(α/2)).

    The side of the centre is the positive one: left of an arc that runs counter-clockwise.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``centre`` (m, default the origin) and ``radius`` of the circle (m), ``angle`` of the
        middle of the arc and ``half_angle`` α that it covers to each side of it (degrees), and
        the remote ``stress`` (σ_xx, σ_yy, σ_xy) in the axes of the scene, Pa.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._centre = parameters.take("centre", (2,), default=(0.0, 0.0))
        self._radius = parameters.positive("radius")
        turn = np.deg2rad(float(parameters.take("angle", (), default=0.0)))
        degrees = parameters.positive("half_angle")
        if degrees >= 180.0:
            raise InputError(f"parameters.half_angle = {degrees:g}; expected less than 180")
        self._alpha = np.deg2rad(degrees)
        c, s = np.cos(turn), np.sin(turn)
        self._axes = np.array([[c, s], [-s, c]])
        s_xx, s_yy, s_xy = parameters.take("stress", (3,))
        local = self._axes @ np.array([[s_xx, s_xy], [s_xy, s_yy]]) @ self._axes.T
        gamma = (local[0, 0] + local[1, 1]) / 4
        self._g = complex((local[1, 1] - local[0, 0]) / 2, local[0, 1])
        cosine, square = np.cos(self._alpha), np.sin(self._alpha) ** 2
        self._d = complex(
            (4 * gamma + 0.5 * square * self._g.real) / (3 - cosine),
            0.5 * square * self._g.imag / (1 + cosine),
        )
        self._c = 2 * gamma - self._d
        turn = np.pi * np.arange(2 * _TERMS) / _TERMS
        ring = np.asarray(0.5 * np.exp(1j * turn), dtype=complex)
        series = np.fft.fft(np.stack(self._closed(ring, np.ones(len(ring)))), axis=1)
        powers = 0.5 ** np.arange(_TERMS)
        self._series = series[:, :_TERMS] / (2 * _TERMS * powers)

    @property
    def singular_points(self) -> Array:
        """Both tips (2, 2), the one at the start of the arc first."""
        turn = np.array([-self._alpha, self._alpha])
        at = self._radius * np.column_stack([np.cos(turn), np.sin(turn)])
        return np.asarray(self._centre + at @ self._axes)

    def intensity_at(self, tip: Array) -> tuple[float, float]:
        """Compute K_I and K_II at the tip (2,) nearest to a point, Pa·√m.

        Shear is positive as the sides slide in the axes of the tip: x ahead of the crack, y to
        the left of it.
        """
        first, last = np.linalg.norm(self.singular_points - tip, axis=1)
        sign = 1.0 if last <= first else -1.0
        # the start of the arc is the end of its mirror image
        d, g = (self._d, self._g) if sign > 0 else (self._d.conjugate(), self._g.conjugate())
        turned = (d - g.conjugate() * np.exp(-1j * self._alpha)) * np.exp(-0.5j * self._alpha)
        k = turned * np.sqrt(np.pi * self._radius * np.sin(self._alpha))
        return float(k.real), float(-sign * k.imag)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 2), m; see `ExactSolution`."""
        z, f = self._evaluate(points, near)
        w = self.law.kolosov * f.phi - z * f.phi_1.conj() - f.psi.conj()
        w = w * self._radius / (2 * self.law.shear)
        return np.asarray(np.column_stack([w.real, w.imag]) @ self._axes)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 2, 2), nan at a tip. See `ExactSolution`."""
        z, f = self._evaluate(points, near)
        with np.errstate(invalid="ignore"):  # at a tip ∞ − ∞: the limit depends on the way there
            dz = self.law.kolosov * f.phi_1 - f.phi_1.conj()
            dz_bar = -z * f.phi_2.conj() - f.psi_1.conj()
        return complex_gradient(dz, dz_bar, self.law.shear, self._axes)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Find where a segment crosses the crack; see `ExactSolution`."""
        a, b = self._local(np.stack([start, end]))
        along = b - a
        middle = -(a.conjugate() * along).real / abs(along) ** 2
        square = (1.0 - abs(a + middle * along) ** 2) / abs(along) ** 2
        if square <= 0.0:
            return []
        both = middle + np.array([-1.0, 1.0]) * np.sqrt(square)
        on = self._on_arc(a + both * along)
        return [float(t) for t in both[on] if 0.0 < t < 1.0]

    def _local(self, points: Array) -> Complex:
        x, y = ((np.asarray(points, dtype=float) - self._centre) @ self._axes.T / self._radius).T
        return np.asarray(x + 1j * y)

    def _on_arc(self, z: Complex) -> NDArray[np.bool_]:
        """Tell whether points of the circle lie on the crack."""
        return np.asarray(np.abs(np.angle(z)) < self._alpha)

    def _evaluate(self, points: Array, near: Array | None) -> tuple[Complex, _Potentials]:
        z = self._local(points)
        sheet = np.ones(len(z))
        if near is not None:
            z_n = self._local(near)
            across = (self._ratio(z).imag >= 0.0) != (self._ratio(z_n).imag >= 0.0)
            # where the way from `near` crosses the circle
            out, out_n = np.abs(z) - 1.0, np.abs(z_n) - 1.0
            share = np.divide(out_n, out_n - out, out=np.ones_like(out), where=out != out_n)
            sheet[across & self._on_arc(z_n + np.clip(share, 0.0, 1.0) * (z - z_n))] = -1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.stack(self._closed(z, sheet))
        # the series belongs to the side of the centre
        central = (np.abs(z) < _NEAR_CENTRE) & (sheet > 0.0)
        found[:, central] = np.polynomial.polynomial.polyval(z[central], self._series.T)
        return z, _Potentials(*found)

    def _ratio(self, z: Complex) -> Complex:
        """Map the crack to the negative real axis, the side of the centre above it."""
        tip = np.exp(1j * self._alpha)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((z - tip) / (z - tip.conjugate()) * tip.conjugate() + 0.0)

    def _closed(self, z: Complex, sheet: Array) -> _Potentials:
        """Return potentials in closed form; `sheet` is −1 where they are continued across crack."""
        d, g, c, cosine = self._d, self._g, self._c, np.cos(self._alpha)
        tip = np.exp(1j * self._alpha)
        # conj(tip)·√((z−a)/(z−b)) has its branch cut on the crack
        root = sheet * (z - tip.conjugate()) * np.exp(0.5j * self._alpha) * np.sqrt(self._ratio(z))
        slope = (z - cosine) / root  # X'
        bend = 1.0 / root - slope**2 / root  # X''
        gz = g.conjugate() / z
        phi = 0.5 * ((d - gz) * root - gz + c * z)
        phi_1 = 0.5 * ((d - gz) * slope + gz / z * (root + 1.0) + c)
        phi_2 = 0.5 * ((d - gz) * bend + 2 * gz / z * slope - 2 * gz / z**2 * (root + 1.0))
        dc = d.conjugate()
        inner = 0.5 * (g * z**2 - c.conjugate() - (dc - g * z) * root)
        inner_1 = 0.5 * (2 * g * z - (dc - g * z) * slope + g * root)
        psi = (inner - phi_1) / z
        return _Potentials(phi, phi_1, phi_2, psi, (inner_1 - phi_2 - psi) / z)


class CircularCut(ExactSolution):
    """The disc or ball r < b at rest; outside u_r = A r + B r^(1−d), free of traction at r = b.

    Lamé's fields: (dλ+2μ) A = 2(d−1)μ B/b^d, with d = 2 in the plane and 3 in space. The inner
    side is the positive one: left of an arc that runs counter-clockwise.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``centre`` (m, default the origin), ``radius`` b of the cut (m), and the displacement
        ``outward`` (m) at the distance ``at`` (m) from the centre.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        d = law.dimension
        self._centre = parameters.take("centre", (d,), default=(0.0,) * d)
        self._b = parameters.positive("radius")
        outward, at = float(parameters.take("outward", ())), parameters.positive("at")
        if at <= self._b:
            raise InputError(
                f"parameters.at = {at:g} lies inside the cut of radius {self._b:g}; expected a "
                "distance outside it"
            )
        inverse = (d * law.lame + 2 * law.shear) / (2 * (d - 1) * law.shear) * self._b**d
        self._a = outward / (at + inverse * at ** (1 - d))
        self._inverse = self._a * inverse

    def _from_centre(self, points: Array, near: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        decides = np.asarray(points if near is None else near) - self._centre
        inside = np.linalg.norm(decides, axis=1) <= self._b
        return np.asarray(points, dtype=float) - self._centre, inside

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d), m; see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        power = np.linalg.norm(r, axis=1) ** self.dimension
        factor = self._a + self._inverse / np.where(inside, np.inf, power)
        return np.asarray(np.where(inside, 0.0, factor)[:, None] * r)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d); see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        d, squared = self.dimension, np.where(inside, np.inf, np.sum(r**2, axis=1))
        round_ = self._inverse / squared ** (d / 2)
        found = (self._a + round_)[:, None, None] * np.eye(d)
        found -= (d * round_ / squared)[:, None, None] * r[:, :, None] * r[:, None, :]
        return np.asarray(np.where(inside[:, None, None], 0.0, found))

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a body, J; see `ExactSolution`. A box may reach into the ball."""
        if self.dimension == 2:
            return super().strain_energy(body)
        lame, shear, b = self.law.lame, self.law.shear, self._inverse
        uniform = 1.5 * (3 * lame + 2 * shear) * self._a**2
        return _radial_energy(box_of(body), self._centre, self._b, (uniform, 6 * shear * b**2))

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Find where a segment crosses the cut; see `ExactSolution`."""
        along, away = end - start, start - self._centre
        a, b, c = along @ along, along @ away, away @ away - self._b**2
        root = b * b - a * c
        if root <= 0.0:
            return []
        both = ((-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a)
        return [float(share) for share in both if 0.0 < share < 1.0]


def _radial_energy(
    corners: Array, centre: Array, radius: float, terms: tuple[float, float]
) -> float:
    """Compute the integral over a box, outside a ball, of the density w₀ + w₁/r⁶, J.

    With g r³ = ∫_b^r s² (w₀ + w₁/s⁶) ds, which is 0 inside the ball, the density is div(x g). Its
    flux through a face at the distance h is h ∫ g dA. Let G(ϱ) = ∫_0^ϱ g s ds around the foot of
    the centre. Then ∫ g dA = Σ ∫ G (ξ dη − η dξ)/ϱ² over the edges.

    Parameters
    ----------
    corners : (2, 3) array
        Lower and upper corner of the box, m.
    centre : (3,) array
    radius : float
        b, m.
    terms : (float, float)
        w₀ (J/m³) and w₁ (J m³).
    """
    w0, w1, b = *terms, radius

    def primitive(r: Array) -> Array:
        """Compute ∫ g r dr from b to r ≥ b."""

        def at(r: Array) -> Array:
            return np.asarray(
                w0 / 3 * (r**2 / 2 + b**3 / r) + w1 / 3 * (0.25 / r**4 - 1.0 / (b**3 * r))
            )

        return at(np.maximum(r, b)) - at(np.asarray(b))

    low, high = corners - centre
    total = 0.0
    for axis in range(3):
        across = [k for k in range(3) if k != axis]
        rectangle = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        outline = np.where(rectangle, high[across], low[across])
        for height in (high[axis], -low[axis]):
            total += height * _over_rectangle(outline, abs(height), b, primitive)
    return total


def _over_rectangle(
    outline: Array, height: float, radius: float, primitive: Callable[[Array], Array]
) -> float:
    """∫ g dA over a rectangle (4, 2) around the foot of the centre, which may lie outside it."""
    found = 0.0
    inner = primitive(np.asarray(height))  # G starts at the foot
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        edge = end - start
        moment = start[0] * edge[1] - start[1] * edge[0]
        for low, high in _smooth_parts(start, edge, height, radius):
            share = low + (high - low) * _POINTS
            squared = np.sum((start + share[:, None] * edge) ** 2, axis=1)
            value = primitive(np.sqrt(squared + height**2)) - inner
            found += moment * (high - low) * float(value / squared @ _WEIGHTS)
    return found


def _smooth_parts(
    start: Array, edge: Array, height: float, radius: float
) -> list[tuple[float, float]]:
    """Find parts of [0, 1], halved towards point next to the foot, without the sphere inside."""
    a, b = edge @ edge, edge @ start
    stops = {0.0, 1.0, float(np.clip(-b / a, 0.0, 1.0))}
    root = b * b - a * (start @ start + height**2 - radius**2)
    if root > 0.0:
        stops |= {float(s) for s in ((-b - root**0.5) / a, (-b + root**0.5) / a) if 0 < s < 1}
    nearest = np.clip(-b / a, 0.0, 1.0)
    for k in range(1, 12):
        stops |= {float(nearest * (1 - 0.5**k)), float(nearest + (1 - nearest) * 0.5**k)}
    ordered = sorted(stops)
    return [(s, t) for s, t in pairwise(ordered) if t > s]


class _Derivatives(NamedTuple):
    """Derivatives (n,) of the harmonic function f at z ≥ 0, those by r over r where odd in r."""

    z: Array
    r_r: Array  # f_r / r
    zz: Array
    rz_r: Array  # f_rz / r
    zzz: Array
    zzr_r: Array  # f_zzr / r
    # by harmonicity, f_rr = −f_r/r − f_zz; 0 on the axis, where x², xy, y² multiply them
    bend: Array  # (1/r) ∂_r (f_r/r)
    bend_z: Array  # (1/r) ∂_r (f_rz/r)
    twice_bend: Array  # (1/r) ∂_r of the first


class Penny(ExactSolution):
    """A circular crack of radius a in a body under remote stress, with a pressure in it.

    Opening by a pull N (I. N. Sneddon, Proc. R. Soc. Lond. A 187, 1946), around the axis, with z
    along it: 2μ u_r = B [(1−2ν) f_r + z f_rz]; 2μ u_z = B [−2(1−ν) f_z + z f_zz]; B = 2Na²/3π.
    Shear T along x (M. K. Kassir & G. C. Sih, J. Appl. Mech. 33, 1966): 2μ u_x = C [−2(1−ν) f_z + z
    f_xx]; 2μ u_y = C z f_xy; 2μ u_z = C [−(1−2ν) f_x + z f_xz]; C = 4Ta²/(3π(2−ν)). Both u_x and
    u_y are odd in z. The function f is harmonic; in oblate coordinates z = aζm, r² = a²(1+ζ²)(1−m²)
    its derivatives are elementary, with r² + (z+ia)² = R², R = a(ζ+im). To both comes the field of
    the uniform remote stress.

    Parameters: ``centre`` (m, default the origin); ``normal`` of the crack (default z); radius
    ``a`` (m); remote ``tension`` across the crack (Pa) or in its place the remote ``stress`` (3 ×
    3, Pa, in the axes of the scene); ``pressure`` on the faces (Pa, default 0). Faces that are not
    pulled open overlap.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._centre = parameters.take("centre", (3,), default=np.zeros(3))
        axes = plane_axes(parameters) if parameters.has("normal") else np.eye(3)
        self._a = parameters.positive("a")
        if parameters.has("stress"):
            remote = parameters.take("stress", (3, 3))
            if not np.allclose(remote, remote.T, rtol=1e-12, atol=0.0):
                raise InputError("parameters.stress of 'penny' is not symmetric")
        else:
            remote = float(parameters.take("tension", ())) * np.outer(axes[2], axes[2])
        self._pressure = float(parameters.take("pressure", (), default=0.0))
        vector = axes @ remote @ axes[2]
        self._shear = float(np.hypot(vector[0], vector[1]))
        if self._shear > 0.0:  # x along the shear
            turn = np.array([[vector[0], vector[1]], [-vector[1], vector[0]]]) / self._shear
            axes = np.vstack([turn @ axes[:2], axes[2]])
        self._axes, self._pull = axes, float(vector[2]) + self._pressure
        nu = self._ratio = law.lame / (2 * (law.lame + law.shear))
        young = 2 * law.shear * (1 + nu)
        local = axes @ remote @ axes.T
        self._strain = ((1 + nu) * local - nu * np.trace(local) * np.eye(3)) / young
        size = self._a**2 / (3 * np.pi) / (2 * law.shear)
        self._opens, self._slides = 2 * self._pull * size, 4 * self._shear / (2 - nu) * size

    @property
    def stress_intensity(self) -> float:
        """K_I, the same along the whole front, Pa·√m."""
        return float(2 * self._pull * np.sqrt(self._a / np.pi))

    def intensity_at(self, point: Array) -> tuple[float, float, float]:
        """K_I, K_II and K_III at a point of the front, Pa·√m, in the axes of `CircularFront`."""
        x, y, _ = self._axes @ (np.asarray(point, dtype=float) - self._centre)
        ahead, third = np.array([x, y]) / np.hypot(x, y), np.array([y, -x]) / np.hypot(x, y)
        root = 4 * self._shear * np.sqrt(self._a / np.pi) / (2 - self._ratio)
        return (
            self.stress_intensity,
            float(root * ahead[0]),
            float((1 - self._ratio) * root * third[0]),
        )

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a box that holds the whole crack, J: with the work of the pressure."""
        opened = 16 * (1 - self._ratio) * self._pull * self._a**3 / (6 * self.law.shear)
        return super().strain_energy(body) + 0.5 * self._pressure * opened

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 3), m; see `ExactSolution`."""
        s, z, upper, f = self._evaluate(points, near)
        nu, x, y = self._ratio, s[:, 0], s[:, 1]
        with np.errstate(invalid="ignore"):  # z f_rz is 0 · ∞ at the front, and 0 there
            spread = self._opens * ((1 - 2 * nu) * f.r_r + _times(z, f.rz_r))
            rise = self._opens * (-2 * (1 - nu) * f.z + _times(z, f.zz))
            bend = _times(z, f.bend)
            along = self._slides * upper * (-2 * (1 - nu) * f.z + _times(z, f.r_r) + bend * x**2)
            across = self._slides * upper * bend * x * y
            lift = self._slides * (-(1 - 2 * nu) * f.r_r + _times(z, f.rz_r)) * x
        local = np.column_stack([spread * x + along, spread * y + across, upper * rise + lift])
        return np.asarray((local + s @ self._strain) @ self._axes)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 3, 3), nan at the front. See `ExactSolution`."""
        s, z, upper, f = self._evaluate(points, near)
        # on the axis 0/0, and at the front ∞ − ∞: the limit depends on the way there
        with np.errstate(divide="ignore", invalid="ignore"):
            local = self._opens * self._opening(s, z, upper, f)
            if self._slides > 0.0:
                local += self._slides * self._shearing(s, z, upper, f)
            return turned(local + self._strain, self._axes)

    def _opening(self, s: Array, z: Array, upper: Array, f: _Derivatives) -> Array:
        """Compute the gradient of the opening by a pull, of B = 2μ."""
        nu, (x, y) = self._ratio, s[:, :2].T
        spread = (1 - 2 * nu) * f.r_r + z * f.rz_r
        bend = (1 - 2 * nu) * f.bend + z * f.bend_z
        by_z = ((2 - 2 * nu) * f.rz_r + z * f.zzr_r) * upper
        rise_r = ((2 * nu - 2) * f.rz_r + z * f.zzr_r) * upper
        rise_z = (2 * nu - 1) * f.zz + z * f.zzz
        rows = [
            [spread + bend * x * x, bend * x * y, by_z * x],
            [bend * x * y, spread + bend * y * y, by_z * y],
            [rise_r * x, rise_r * y, rise_z],
        ]
        return matrices(rows)

    def _shearing(self, s: Array, z: Array, upper: Array, f: _Derivatives) -> Array:
        """Compute the gradient of the sliding by a shear along x, of C = 2μ."""
        nu, (x, y) = self._ratio, s[:, :2].T
        xx, xy = f.r_r + x * x * f.bend, x * y * f.bend
        xxz, xyz = f.rz_r + x * x * f.bend_z, x * y * f.bend_z
        xxx = 3 * x * f.bend + x**3 * f.twice_bend
        xxy, xyy = y * f.bend + x * x * y * f.twice_bend, x * f.bend + x * y * y * f.twice_bend
        slow, xz, yz = -2 * (1 - nu), x * f.rz_r, y * f.rz_r
        rows = [
            [(slow * xz + z * xxx) * upper, (slow * yz + z * xxy) * upper,
             slow * f.zz + xx + z * xxz],
            [z * xxy * upper, z * xyy * upper, xy + z * xyz],
            [-(1 - 2 * nu) * xx + z * xxz, -(1 - 2 * nu) * xy + z * xyz,
             (2 * nu * xz + z * x * f.zzr_r) * upper],
        ]  # fmt: skip
        return matrices(rows)

    def _evaluate(
        self, points: Array, near: Array | None
    ) -> tuple[Array, Array, Array, _Derivatives]:
        """Compute local points, |z|, the sign of the side, and the derivatives of f."""
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
        r_r = -(1.5 / a**2) * (angle - zeta / (1 + zeta**2))
        zz = (3 / a**2) * (angle - a * inverse.real)
        zzz = (3 / a**2) * (inverse.imag + a * ((z + 1j * a) * cubed).real)
        zzr_r = (3 / a**2) * (-zeta / (a**2 * spread * (1 + zeta**2)) + a * cubed.real)
        off, square = r > _AXIS * a, np.maximum(r, _AXIS * a) ** 2
        bend = np.where(off, (-2 * r_r - zz) / square, 0.0)
        return _Derivatives(
            -(3 * m / a) * (1 - zeta * angle),
            r_r,
            zz,
            rz_r,
            zzz,
            zzr_r,
            bend,
            np.where(off, (-2 * rz_r - zzz) / square, 0.0),
            np.where(off, (-4 * bend - zzr_r) / square, 0.0),
        )


def _times(z: Array, values: NDArray[np.float64]) -> Array:
    """Multiply; 0 where z is."""
    return np.where(z > 0.0, z * values, 0.0)
