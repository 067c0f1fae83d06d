"""Straight cracks: in the plane by complex potentials (Kolosov–Muskhelishvili), and their fronts.

In the axes of the crack, z = x + iy, with functions φ, ω that are analytic off the crack,

    2μ (u + iv) = κ φ(z) − ω(z̄) − (z − z̄) conj φ'(z),

which leaves the faces y = 0± free of traction wherever φ± = −ω∓ there up to a constant.
"""

from abc import abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact.solution import (
    Array,
    ExactSolution,
    Hooke,
    Parameters,
    complex_gradient,
    outline_of,
    plane_axes,
    turned,
)
from verify.errors import InputError
from verify.geometry.planar import inner_parts
from verify.geometry.simplices import unit_rule
from verify.scene import Scene

Complex = NDArray[np.complex128]


class Potentials(NamedTuple):
    """Values (n,) of φ, φ', φ'' at z and of ω, ω' at z̄."""

    phi: Complex
    phi_1: Complex
    phi_2: Complex
    omega: Complex
    omega_1: Complex


class ComplexCrack(ExactSolution):
    """A straight crack on the x axis of its own frame.

    Parameters
    ----------
    law : Hooke
    origin : (2,) array
        Origin of the frame, m.
    angle : float
        Angle of its x axis, degrees.
    """

    def __init__(self, law: Hooke, origin: Array, angle: float) -> None:
        super().__init__(law)
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        self._origin = origin
        self._axes = np.array([[c, s], [-s, c]])
        # displacement and gradient are mostly asked for at the same points; a field does not
        # change once it is made
        self._last: tuple[Array, tuple[Complex, Potentials]] | None = None

    @abstractmethod
    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        """Return potentials; `sheet` is −1 where the root is to be continued across the crack."""

    @abstractmethod
    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        """Tell whether points of the x axis lie on the crack."""

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 2), m; see `ExactSolution`."""
        z, f = self._evaluate(points, near)
        # at a tip φ' is infinite, but its factor is zero there
        slope = np.where(z.imag == 0.0, 0.0, f.phi_1)
        w = self.law.kolosov * f.phi - f.omega - (z - z.conj()) * slope.conj()
        w = w / (2 * self.law.shear)
        return np.column_stack([w.real, w.imag]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 2, 2), nan at a tip. See `ExactSolution`."""
        z, f = self._evaluate(points, near)
        with np.errstate(invalid="ignore"):  # at a tip ∞ − ∞: the limit depends on the way there
            dz = self.law.kolosov * f.phi_1 - f.phi_1.conj()
            dz_bar = -f.omega_1 + f.phi_1.conj() - (z - z.conj()) * f.phi_2.conj()
        return complex_gradient(dz, dz_bar, self.law.shear, self._axes)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Find where the segment from `start` to `end` meets the crack."""
        (x0, y0), (x1, y1) = (np.stack([start, end]) - self._origin) @ self._axes.T
        if y0 == y1:
            return []
        t = float(y0 / (y0 - y1))
        return [t] if 0.0 < t < 1.0 and self._on_crack(np.array([x0 + t * (x1 - x0)]))[0] else []

    def potentials(self, points: Array, near: Array | None = None) -> Potentials:
        """Return potentials at points (n, 2), on the sides of `near` (n, 2)."""
        return self._evaluate(points, near)[1]

    def _evaluate(self, points: Array, near: Array | None) -> tuple[Complex, Potentials]:
        sided = near is not None and near is not points
        asked = np.array([points, near] if sided else [points], dtype=float)
        if self._last is not None and np.array_equal(asked, self._last[0]):
            return self._last[1]
        x, y = ((np.asarray(points, dtype=float) - self._origin) @ self._axes.T).T
        y = y + 0.0  # −0 would choose the lower face
        sheet = np.ones(len(x))
        if sided:
            x_n, y_n = ((np.asarray(near, dtype=float) - self._origin) @ self._axes.T).T
            y = np.where((y == 0.0) & (y_n < 0.0), -0.0, y)
            across = y * y_n < 0.0
            # where the way from `near` crosses the x axis
            share = np.divide(y_n, y_n - y, out=np.zeros_like(y), where=across)
            sheet[across & self._on_crack(x_n + share * (x - x_n))] = -1.0
        z = np.empty(len(x), dtype=complex)
        z.real, z.imag = x, y  # x + 1j*y would lose the sign of −0
        with np.errstate(divide="ignore", invalid="ignore"):
            found = z, self._potentials(z, sheet)
        self._last = asked, found
        return found


class CrackTip(ComplexCrack):
    """φ = ω = (K_I − i K_II) √(z/2π); the crack lies on x < 0 of the frame of the tip.

    Parameters ``tip`` (m), ``angle`` of the direction in which the crack points (degrees,
    default 0) and ``intensity`` (K_I, K_II), Pa·√m.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        tip = parameters.take("tip", (2,))
        super().__init__(law, tip, float(parameters.take("angle", (), default=0.0)))
        k_1, k_2 = parameters.take("intensity", (2,))
        self._k = complex(k_1, -k_2) / np.sqrt(2 * np.pi)

    @property
    def singular_points(self) -> Array:
        """The tip (1, 2)."""
        return self._origin[None]

    @property
    def stress_intensity(self) -> tuple[float, float]:
        """K_I and K_II, Pa·√m."""
        k = self._k * np.sqrt(2 * np.pi)
        return float(k.real), float(-k.imag)

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(x < 0.0)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        root = sheet * np.sqrt(z)
        bar = root.conj()
        k = self._k
        return Potentials(k * root, 0.5 * k / root, -0.25 * k / root**3, k * bar, 0.5 * k / bar)


class Griffith(ComplexCrack):
    """φ = ½ S R + Γ z, ω = ½ S R − Γ z, with R = √(z−a) √(z+a).

    S = σ_yy − iσ_xy and Γ = (σ_xx − σ_yy)/4 + iσ_xy/2 of the remote stress in the crack's axes.
    Parameters: ``centre`` (m, default the origin); half-length ``a`` (m); ``angle`` (degrees,
    default 0); the remote ``stress`` (σ_xx, σ_yy, σ_xy) in the axes of the scene; the ``pressure``
    p (Pa, default 0) on the faces. A pressure gives the field of free faces under the remote stress
    σ + p I, less the uniform stress p I.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        centre = parameters.take("centre", (2,), default=(0.0, 0.0))
        super().__init__(law, centre, float(parameters.take("angle", (), default=0.0)))
        self._a = parameters.positive("a")
        s_xx, s_yy, s_xy = parameters.take("stress", (3,))
        self._pressure = float(parameters.take("pressure", (), default=0.0))
        remote = np.array([[s_xx, s_xy], [s_xy, s_yy]]) + self._pressure * np.eye(2)
        local = self._axes @ remote @ self._axes.T
        self._shrinkage = self._pressure / (2 * (law.lame + law.shear))
        self._s = complex(local[1, 1], -local[0, 1])
        self._gamma = complex((local[0, 0] - local[1, 1]) / 4, local[0, 1] / 2)

    @property
    def singular_points(self) -> Array:
        """Both tips (2, 2)."""
        reach: Array = self._a * self._axes[0]
        return np.stack([self._origin - reach, self._origin + reach])

    @property
    def stress_intensity(self) -> tuple[float, float]:
        """K_I and K_II, Pa·√m (negative K_I: the faces would overlap)."""
        root = np.sqrt(np.pi * self._a)
        return self._s.real * root, -self._s.imag * root

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 2), m; see `ExactSolution`."""
        return super().displacement(points, near) - self._shrinkage * (points - self._origin)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 2, 2), nan at a tip. See `ExactSolution`."""
        return super().gradient(points, near) - self._shrinkage * np.eye(2)

    def strain_energy(self, body: Array | Scene) -> float:
        """Compute strain energy of a body, J/m: half the work on its outline and on the faces."""
        energy = super().strain_energy(body)
        if self._pressure == 0.0:
            return energy
        # the opening is an ellipse: smooth in the angle of x = a sin θ
        nodes, weights = unit_rule(64)
        for start, end in inner_parts(self.singular_points, outline_of(body)):
            ends = (np.array([start, end]) - self._origin) @ self._axes[0] / self._a
            low, high = np.arcsin(np.clip(ends, -1.0, 1.0))
            angle = low + (high - low) * nodes
            points = self._origin + np.outer(self._a * np.sin(angle), self._axes[0])
            above, below = (
                self.displacement(points, points + side * self._a * self._axes[1])
                for side in (1.0, -1.0)
            )
            opening = (above - below) @ self._axes[1]
            length = (high - low) * self._a * np.cos(angle) * weights
            energy += 0.5 * self._pressure * float(opening @ length)
        return energy

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(np.abs(x) < self._a)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        a, s, gamma = self._a, self._s, self._gamma
        root = _root(z, sheet, a)
        bar = root.conj()
        return Potentials(
            0.5 * s * root + gamma * z,
            0.5 * s * z / root + gamma,
            np.asarray(-0.5 * s * a**2 / (root * root * root), dtype=complex),
            0.5 * s * bar - gamma * z.conj(),
            0.5 * s * z.conj() / bar - gamma,
        )


def _root(z: Complex, sheet: Array, a: float) -> Complex:
    """Compute √(z−a) √(z+a), cut along the crack."""
    # z ∓ a by parts, which keeps a negative zero of the imaginary part
    left, right = z.copy(), z.copy()
    left.real -= a
    right.real += a
    return np.asarray(sheet * np.sqrt(left) * np.sqrt(right))


class ClosedCrack(Griffith):
    """A crack whose faces press on each other without friction, in an infinite plate.

    The uniform field of the remote stress σ, but for its shear along the crack, of which mode II
    of `Griffith` leaves the faces free: K_I = 0, K_II = τ√(πa), and the pressure is −σ_nn.
    Parameters ``centre``, ``a``, ``angle`` and the remote ``stress`` of `Griffith`.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._across, self._s = self._s.real, 1j * self._s.imag
        if self._across > 0.0 or self._pressure:
            raise InputError(
                f"parameters: {self._across:g} Pa across the crack; expected compression, and no "
                "pressure on the faces but their own"
            )

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        f, half = super()._potentials(z, sheet), 0.5 * self._across
        phi, omega = f.phi + half * z, f.omega + half * z.conj()
        return Potentials(phi, f.phi_1 + half, f.phi_2, omega, f.omega_1 + half)


class PartlyClosedCrack(ComplexCrack):
    """A crack −a < x < a in a remote field σ' x, closed without friction on −a < x < −a/3.

    Westergaard's Z = σ' (ξ − c/2) √((ξ+c)/(ξ−c)) with c = 2a/3 and ξ = z − a/3, and φ' = ω' = Z/2:
    there is no shear on the line of the crack, on which σ_yy = Re Z. The stress goes as σ_xx = σ_yy
    = σ' x, σ_xy = −σ' y far away. K_I(a) = σ' c √(πc); at −a/3, where the faces begin to press on
    each other, it is zero, and at −a the field is smooth (H. M. Westergaard, J. Appl. Mech. 6,
    1939; the place of −a/3 by K_I = 0 there).

    Parameters ``centre`` of the crack (m, default the origin), half-length ``a`` (m), ``angle``
    (degrees, default 0) and the ``slope`` σ' > 0 (Pa/m).
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        centre = parameters.take("centre", (2,), default=(0.0, 0.0))
        super().__init__(law, centre, float(parameters.take("angle", (), default=0.0)))
        a, self._slope = parameters.positive("a"), parameters.positive("slope")
        self._origin = self._origin + a / 3 * self._axes[0]
        self._c = 2 * a / 3

    @property
    def singular_points(self) -> Array:
        """The tip of the open end (1, 2)."""
        return (self._origin + self._c * self._axes[0])[None]

    @property
    def stress_intensity(self) -> tuple[float, float]:
        """K_I and K_II at the open end, Pa·√m."""
        return float(self._slope * self._c * np.sqrt(np.pi * self._c)), 0.0

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(np.abs(x) < self._c)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        c, s, root = self._c, self._slope, _root(z, sheet, self._c)
        flat = z * z + 0.5 * c * z - 0.5 * c**2  # Z R / σ'
        phi, phi_1 = 0.25 * s * (z + c) * root, 0.5 * s * flat / root
        phi_2 = 0.5 * s * ((2 * z + 0.5 * c) / root - flat * z / (root * root * root))
        return Potentials(phi, phi_1, phi_2, phi.conj(), phi_1.conj())


class StraightFrontField(ExactSolution):
    """Plane strain of modes I and II across a straight front, antiplane shear along it.

    In the axes ahead of the front, normal to the crack, and along the front (ahead × normal),
    with z = x + iy: the plane field of `CrackTip`, and u_3 = (2 K_III/μ) Im √(z/2π)
    (M. L. Williams, J. Appl. Mech. 24, 1957). The faces, behind the front, are free of traction.
    Antiplane shear alone is exact for neo-Hookean material too, at any strain: det F is 1, and the
    first Piola stress is μ (e₃ ⊗ ∇u_3 + ∇u_3 ⊗ e₃), as in linear elasticity.

    Parameters: ``point`` of the front (m); ``normal`` of the crack towards its positive side;
    ``axis``, the direction ahead, projected onto its plane; ``intensity`` (K_I, K_II, K_III),
    Pa·√m.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._origin = parameters.take("point", (3,))
        ahead, _, normal = plane_axes(parameters)
        self._axes = np.stack([ahead, normal, np.cross(ahead, normal)])
        self._k = parameters.take("intensity", (3,))
        if law.model != "hooke" and self._k[:2].any():
            raise InputError(
                "parameters: intensity I and II in neo-Hookean material; expected III alone"
            )
        self._plane = _tip(law, self._k[:2])
        self._unit = _tip(law, np.array([1.0, 0.0]))  # its potential is √(z/2π)

    @property
    def stress_intensity(self) -> tuple[float, float, float]:
        """K_I, K_II and K_III, Pa·√m, in the axes ahead, normal, ahead × normal."""
        k_1, k_2, k_3 = self._k
        return float(k_1), float(k_2), float(k_3)

    def strain_energy(self, body: Array | Scene) -> float:
        """Refuse: the front is where the quadrature of `ExactSolution` would need its own rule."""
        raise InputError("the strain energy around a straight front is not computed")

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, 3), m; see `ExactSolution`."""
        x, beside = self._places(points, near)
        third = 2 * self._k[2] / self.law.shear * self._unit.potentials(x, beside).phi.imag
        return np.column_stack([self._plane.displacement(x, beside), third]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, 3, 3), nan at the front. See `ExactSolution`."""
        x, beside = self._places(points, near)
        slope = 2 * self._k[2] / self.law.shear * self._unit.potentials(x, beside).phi_1
        local = np.zeros((len(x), 3, 3))
        local[:, :2, :2] = self._plane.gradient(x, beside)
        local[:, 2, 0], local[:, 2, 1] = slope.imag, slope.real
        return turned(local, self._axes)

    def _places(self, points: Array, near: Array | None) -> tuple[Array, Array | None]:
        x = self._local(points)
        # the same array says that points are on their own side, which costs nothing
        return x, x if near is points else None if near is None else self._local(near)

    def _local(self, points: Array) -> Array:
        """Find places (n, 2) ahead of the front and across the crack, m."""
        return (np.asarray(points, dtype=float) - self._origin) @ self._axes[:2].T


def _tip(law: Hooke, intensity: Array) -> CrackTip:
    return CrackTip(law, Parameters("tip", {"tip": [0.0, 0.0], "intensity": intensity}))
