"""Fields without a tip: uniform strains, waves, layers of two materials, halves rolled apart.

Layers meet along a line which a straight cut crosses; the field is linear on each of four parts.
Tension S along the cut, another on each side, leaves the cut free and is in equilibrium with itself
across the interface. Each material has its own strains; they are compatible if both materials
strain alike along the interface, τ·ε τ: at one angle for two given materials. The rest of the jump,
which shears, is a rotation of the second material.
"""

from math import prod

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.optimize import brentq, root

from reference.exact.solution import (
    Above,
    Array,
    ExactSolution,
    Hooke,
    Parameters,
    TwoSidedSolution,
    hooke,
    line_axes,
    matrices,
    side,
)
from verify.errors import InputError
from verify.scene import Material, Scene

_COLLOCATED = 24  # degree across a strip; its analytic radius is known to round-off then
_SOLVED = 1e-8  # residual over μ: round-off of second derivatives is below it


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
        """Compute the displacement (n, d), m."""
        return np.asarray(points, dtype=float) @ self._matrix.T + self._shift

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d)."""
        return np.broadcast_to(self._matrix, (len(points), *self._matrix.shape)).copy()


class Patch(TwoSidedSolution):
    """F1, uniform strain on each side: u_α = ε_α s_α, u_t = −η Σ ε_α t, plus shift.

    Free of traction at the cut. ``strain`` per side: ε, or in space a row (ε1, ε2). Of neo-Hookean
    material, μ λ_t + H′(J) J/λ_t = 0 gives the stretch λ_t across in place of 1 − η Σ ε_α.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        along = parameters.take("strain", (2,) if law.dimension == 2 else (2, 2)).reshape(2, -1)
        across = -law.eta * along.sum(axis=1)
        if law.model != "hooke":
            if (along <= -1.0).any():
                raise InputError(
                    "parameters: strain; expected more than -1 in neo-Hookean material"
                )
            across = np.array([_free_stretch(law, a) for a in np.prod(1.0 + along, axis=1)]) - 1.0
        self._strain = np.column_stack([along, across])

    def strain_energy(self, body: Array | Scene) -> float:
        """See `ExactSolution`; refused of neo-Hookean material: it is no half of a work."""
        if self.law.model != "hooke":
            raise InputError("the strain energy at finite rotation is integrated over the body")
        return super().strain_energy(body)

    def stress(self, points: Array, near: Array | None = None) -> Array:
        """See `ExactSolution`; refused of neo-Hookean material, whose stress is of its energy."""
        if self.law.model != "hooke":
            raise InputError("tractions of neo-Hookean halves are not offered; expected supports")
        return super().stress(points, near)

    def _local_displacement(self, s: Array, above: Above) -> Array:
        return side(self._strain, above) * s

    def _local_gradient(self, s: Array, above: Above) -> Array:
        return side(self._strain, above)[:, :, None] * np.eye(self.dimension)


def _free_stretch(law: Hooke, along: float) -> float:
    """Compute stretch across a neo-Hookean body whose stretches along have the product `along`."""
    lame, shear = law.lame, law.shear
    if law.model == "stable_neo_hookean":
        return float((lame + 2 * shear) * along / (shear + (lame + shear) * along**2))

    def across(log: float) -> float:  # of the stretch; it ascends for λ ≥ 0
        return float(shear * np.expm1(2 * log) + lame * (np.log(along) + log))

    reach = 1.0 + abs(np.log(along))
    if not across(-reach) < 0.0 < across(reach):
        raise InputError(
            f"no neo-Hookean patch that is stretched by {along:g} along the cut is found"
        )
    return float(np.exp(brentq(across, -reach, reach, xtol=1e-15, rtol=1e-15)))


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
        # one side after the other, column by column: a third of the time of all rows at once
        found = np.empty(len(s))
        for on, (size, *k, phase) in zip((above, ~above), self._rows[:, which], strict=True):
            angle = np.full(np.count_nonzero(on), phase + len(by) * np.pi / 2)
            for one, column in zip(k, s.T[:-1], strict=True):
                angle += one * column[on]
            found[on] = size * prod(k[axis] for axis in by) * np.sin(angle)
        return found

    def _divergence(self, s: Array, above: Above, *by: int) -> Array:
        return np.sum([self._wave(s, above, a, a, *by) for a in self._along], axis=0)

    def _laplacian(self, s: Array, above: Above, which: int, *by: int) -> Array:
        return np.sum([self._wave(s, above, which, a, a, *by) for a in self._along], axis=0)


_FITS = 1e-9  # of the strains: how well they must agree along the interface
_BESIDE = 1e-4, 1e-7  # m: how far along the interface and beside it materials are looked at
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


class Layers(TwoSidedSolution):
    """Uniform stress S s⊗s on each side of the cut, in two materials.

    ``point`` is where the interface crosses the cut.

    Parameters
    ----------
    material : Material
        With one region, whose interface it is.
    parameters : Parameters
        ``point``, ``slope`` or ``angle`` of the cut, ``shift``; ``interface_slope`` or
        ``interface_angle`` (degrees), and ``stress`` S (Pa) above and below the cut.

    Raises
    ------
    InputError
        If the strains do not fit together along the interface, or the regions of the scene have
        no such interface.
    """

    def __init__(self, material: Material, parameters: Parameters) -> None:
        super().__init__(hooke(material), parameters)
        self._stress = parameters.take("stress", (2,))
        along = line_axes(parameters, "interface_")[0] @ self._axes.T  # in the axes of the cut
        self._normal = _QUARTER @ along
        laws = self._laws_beside(material, along @ self._axes)
        # per unit of stress: (left, right) of the interface
        strains = [np.diag([1.0, -one.eta]) / one.plane_modulus for one in laws]
        jump = strains[1] - strains[0]
        if abs(along @ jump @ along) > _FITS * float(np.abs(strains).max()):
            raise InputError(
                f"parameters: along the interface the materials strain by "
                f"{along @ strains[0] @ along:.6g} and {along @ strains[1] @ along:.6g} per Pa of "
                "tension along the cut; expected the same"
            )
        spin = -(self._normal @ jump @ along)
        self._gradients = np.array([strains[0], strains[1] + spin * _QUARTER])

    def stress(self, points: Array, near: Array | None = None) -> Array:
        """Compute the stress (n, 2, 2), Pa, by the material of each point."""
        _, above = self._local(points, near)
        unit = np.outer(self._axes[0], self._axes[0])
        return np.asarray(side(self._stress, above)[:, None, None] * unit)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Compute parameters in (0, 1) at which a segment crosses the interface."""
        a, b = ((point - self._origin) @ self._axes.T @ self._normal for point in (start, end))
        return [float(a / (a - b))] if a * b < 0 else []

    def _laws_beside(self, material: Material, along: Array) -> list[Hooke]:
        """Return laws to the left and to the right of the interface, as the scene has them."""
        steps = [(step, aside) for aside in (1.0, -1.0) for step in (1.0, -1.0)]
        beside = self._origin + np.array(
            [
                step * _BESIDE[0] * along + aside * _BESIDE[1] * (_QUARTER @ along)
                for step, aside in steps
            ]
        )
        number = material.number_at(beside)
        if number[0] != number[1] or number[2] != number[3] or number[0] == number[2]:
            raise InputError(
                "'layers' expects material.regions that differ across the interface through the "
                "point, and not along it"
            )
        return [hooke(material.each[k]) for k in number[[0, 2]]]

    def _local_displacement(self, s: Array, above: Above) -> Array:
        return np.asarray(np.einsum("nij,nj->ni", self._local_gradient(s, above), s))

    def _local_gradient(self, s: Array, above: Above) -> Array:
        second = s @ self._normal < 0.0
        return side(self._stress, above)[:, None, None] * self._gradients[second.astype(int)]


class RolledHalves(TwoSidedSolution):
    """Strips on both sides of a cut, each bent away from the other to a circle of its own.

    A strip |ξ| < h/2 takes the places (r cos cs, r sin cs). Its stretches are λ₁ = dr/dξ across and
    λ₂ = c r along it. There is no body force, and no traction at ξ = ±h/2. In the energy W(λ₁, λ₂)
    equilibrium is d/dξ ∂W/∂λ₁ = c ∂W/∂λ₂, with ∂W/∂λ₁ = 0 at both ends (Rivlin, Proc. R. Soc. Lond.
    A 195, 1949). In the energy μ‖U − I‖² + ½ λ tr²(U − I) that is r = A cosh cξ + B sinh cξ + b/c.
    Here b = 2(λ + μ)/(λ + 2μ); in a neo-Hookean one it is found by collocation, to 1e-12. At s = 0
    the middle lines stay where they are.

    Parameters ``thickness`` h (m) and ``curvature`` c (1/m, positive) per side; ``shift`` (m,
    normal to the cut) per side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._thickness = parameters.take("thickness", (2,))
        self._curvature = parameters.take("curvature", (2,))
        if (self._thickness <= 0.0).any() or (self._curvature <= 0.0).any():
            raise InputError("parameters: thickness and curvature; expected positive numbers")
        lame, shear = law.lame, law.shear
        stiff = lame + 2 * shear
        self._b = 2 * (lame + shear) / stiff
        spare = 2 * (lame + shear) - lame * self._b
        c, h = self._curvature, self._thickness
        self._bent = None
        if law.model != "hooke":
            self._bent = [_bent(law, angle) for angle in c * h]
        self._sinh = spare * stiff / (c * np.cosh(0.5 * c * h) * (stiff**2 - lame**2))
        self._cosh = -lame * self._sinh / stiff

    def strain_energy(self, body: Array | Scene) -> float:
        """Refuse: at finite rotation the linear work on the surface is not the energy."""
        raise InputError("the strain energy at finite rotation is integrated over the body")

    def _radius(self, xi: Array, above: Above) -> tuple[Array, Array]:
        """Compute the radius r (n,), m, and dr/dξ (n,)."""
        c = side(self._curvature, above)
        if self._bent is not None:
            sides = zip(self._bent, self._curvature * self._thickness, strict=True)
            one, other = (_values(R, 2 * c * xi / angle, angle) for R, angle in sides)
            radius, slope = np.where(above, one, other)
            return radius / c, slope
        even, odd = side(self._cosh, above), side(self._sinh, above)
        r = even * np.cosh(c * xi) + odd * np.sinh(c * xi) + self._b / c
        return r, c * (even * np.sinh(c * xi) + odd * np.cosh(c * xi))

    def _local_displacement(self, s: Array, above: Above) -> Array:
        sign, middle = np.where(above, 1.0, -1.0), 0.5 * side(self._thickness, above)
        (x, t), c = s.T, side(self._curvature, above)
        r, _ = self._radius(middle - sign * t, above)
        at_middle, _ = self._radius(np.zeros(len(x)), above)
        # ξ points away from the centre of the circle: towards the cut
        rise = sign * (middle + at_middle - r * np.cos(c * x))
        return np.column_stack([r * np.sin(c * x) - x, rise - t])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        sign, middle = np.where(above, 1.0, -1.0), 0.5 * side(self._thickness, above)
        (x, t), c = s.T, side(self._curvature, above)
        r, slope = self._radius(middle - sign * t, above)
        cos, sin = np.cos(c * x), np.sin(c * x)
        return matrices([[c * r * cos - 1.0, -sign * slope * sin],
                         [sign * c * r * sin, slope * cos - 1.0]])  # fmt: skip


def _values(R: Chebyshev, at: Array, angle: float) -> Array:
    """R and dR/d(cξ) (2, n) at places from −1 to 1 across a strip that turns by an angle."""
    return np.array([R(at), 2 / angle * R.deriv()(at)])


def _bent(law: Hooke, angle: float) -> Chebyshev:
    """R = c r over 2ξ/h of a neo-Hookean strip of thickness h bent to a curvature c = angle/h.

    Raises
    ------
    InputError
        If no equilibrium is found.
    """
    lame, shear = law.lame, law.shear

    def slopes(one: Array, two: Array) -> tuple[Array, Array]:
        """Compute ∂W/∂λ₁ and ∂W/∂λ₂, over μ."""
        J = one * two
        volume = (lame * np.log(J) / shear - 1) / J
        if law.model == "stable_neo_hookean":
            volume = (lame / shear + 1) * (J - 1) - 1
        return one + volume * two, two + volume * one

    at = np.cos(np.pi * np.arange(_COLLOCATED + 1) / _COLLOCATED)

    def residual(values: Array) -> Array:
        R = Chebyshev.fit(at, values, _COLLOCATED, domain=(-1.0, 1.0))
        across, along = slopes(2 / angle * R.deriv()(at), values)
        stress = Chebyshev.fit(at, across, _COLLOCATED, domain=(-1.0, 1.0))
        left: Array = 2 / angle * stress.deriv()(at) - along
        left[0], left[-1] = across[0], across[-1]
        return left

    with np.errstate(invalid="ignore", divide="ignore"):
        found = root(residual, 1 + angle / 2 * at, tol=1e-14)
        left = np.abs(residual(found.x)).max()
    if not left <= _SOLVED:
        raise InputError(
            f"no neo-Hookean strip that turns by {angle:g} over its thickness is found"
        )
    return Chebyshev.fit(at, found.x, _COLLOCATED, domain=(-1.0, 1.0))
