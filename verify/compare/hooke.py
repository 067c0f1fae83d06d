"""Isotropic elasticity as the comparison needs it: densities, strain, stress, and energies.

Linear: ½ σ:ε. Corotated: μ‖U − I‖² + ½ λ tr²(U − I), the energy whose gradient the corotational
formulation with polar rotations is; U is the stretch of F = I + ∇u = R U. A membrane has the same
of the two stretches in its tangent plane, times its thickness, with the λ of plane stress.
Neo-Hookean: ½μ(‖F‖² − d) + H(J), J = det F, with H of one of two models.

Strain and stress are full tensors in space: ε = sym ∇u and σ = λ tr(ε) I + 2μ ε. Corotational
kinematics and membranes have Biot strain U − I and Biot stress of the same form, neo-Hookean bodies
Biot stress by their energy. Biot tensors do not change as a body turns. Components across follow
from plane strain, plane stress or the membrane.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Self
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from verify.compare.body_rule import Rule
from verify.compare.cell_tree import axes_of
from verify.compare.locate import Field, SolutionField, difference_squares, squares
from verify.compare.mass import separated_parts
from verify.compare.simplices import in_frames, simplex_rule, triangle_frames
from verify.compiled import COMPILED, njit
from verify.errors import InputError
from verify.geometry.simplices import determinants
from verify.scene import Material, Scene
from verify.solution import Solution

_AT_ONCE = 1 << 11  # matrices: their arrays stay in the cache
_NEWTON_STEPS, _SETTLED = 9, 1e-9  # the last step; its square is left

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hooke:
    """Lamé constants (Pa), with the plane λ in plane stress; of a membrane in N/m.

    Parameters
    ----------
    lame, shear : float or (n,) array
        λ and μ; one for each of n gradients after `at`.
    material : Material, optional
        Given where materials differ by region: the constants then belong to ``[material]``.
    """

    lame: float | Array
    shear: float | Array
    material: Material | None = None

    def at(self, points: Array) -> Self:
        """Return the law at points (n, d): itself, unless materials differ by region.

        Interfaces are where the scene has them, whatever cells a solver gave which material.
        """
        if self.material is None:
            return self
        pairs = np.array([_constants(one) for one in self.material.each])
        lame, shear = pairs[self.material.number_at(points)].T
        return replace(self, lame=lame, shear=shear, material=None)

    def energy_density(self, gradient: Array) -> Array:
        """Compute ½ σ:ε (n,) in J/m³ of displacement gradients (n, d, d)."""
        _, _, trace2, square, _ = difference_squares(gradient, gradient)
        return np.asarray(0.5 * self.lame * trace2 + self.shear * square)

    def piola(self, gradient: Array) -> Array:
        """Compute the first Piola-Kirchhoff stress, work-conjugate to the gradient, in its shape.

        In Pa, of a membrane N/m: λ tr(ε) I + 2μ ε of ε = sym ∇u.
        """
        stress = np.reshape(self.shear, (-1, 1, 1)) * (gradient + np.swapaxes(gradient, 1, 2))
        trace = self.lame * np.einsum("nii->n", gradient)
        return np.asarray(stress + trace[:, None, None] * np.eye(gradient.shape[1]))

    def error_density(self, difference: Array, expected: Array) -> Array:
        """Compute energy density (n,) of the difference of a gradient from an `expected` one."""
        return self.energy_density(difference)

    def compared(self, found: Array, expected: Array) -> tuple[Array, Array, Array]:
        """Compute energy densities (n,) of the difference of gradients and of `expected`, J/m³.

        The third (n,) are the sums of squares of the entries of `expected`.
        """
        trace2, square, own_trace2, own_square, entries = difference_squares(found, expected)
        difference = 0.5 * self.lame * trace2 + self.shear * square
        return difference, 0.5 * self.lame * own_trace2 + self.shear * own_square, entries


@dataclass(frozen=True)
class Corotated(Hooke):
    """The same constants, with the energy of the stretch.

    Gradients of a membrane are (n, 3, 2): along two orthonormal tangents, with components along
    these and across the surface, as `verify.compare.simplices.triangle_frames` has them. Its
    energy is in J/m².
    """

    def energy_density(self, gradient: Array) -> Array:
        """Compute μ‖U − I‖² + ½ λ tr²(U − I) (n,) in J/m³ of displacement gradients (n, d, k)."""
        stretch = _stretches_less_one(gradient)
        density: Array = self.shear * np.sum(stretch**2, axis=1)
        density += 0.5 * self.lame * np.sum(stretch, axis=1) ** 2
        return density

    def piola(self, gradient: Array) -> Array:
        """Compute R (2μ(U − I) + λ tr(U − I) I), as gradients."""
        turn, unit = _rotations(gradient), np.eye(*gradient.shape[1:])
        strain = np.swapaxes(turn, 1, 2) @ (unit + gradient) - np.eye(gradient.shape[2])
        return np.asarray(turn @ Hooke.piola(self, strain))

    def compared(self, found: Array, expected: Array) -> tuple[Array, Array, Array]:
        """Return `error_density`, `energy_density`, and squares, as of linear elasticity."""
        turn, energy, entries = _of_expected(self, expected)
        return self._turned_back(found - expected, turn), energy, entries

    def error_density(self, difference: Array, expected: Array) -> Array:
        """Compute energy density (n,) of sym(Rᵀ δ), δ the difference and R the expected rotation.

        It is the linear one in the frame that turns with the expected field: it does not
        change if both fields are turned, and is the exact one to second order.
        """
        return self._turned_back(difference, _rotations(expected))

    def _turned_back(self, difference: Array, turn: Array) -> Array:
        if not COMPILED:
            return Hooke.energy_density(self, np.swapaxes(turn, 1, 2) @ difference)
        rows, (d, k) = np.empty((2, len(turn))), turn.shape[1:]
        turn, difference = np.ascontiguousarray(turn), np.ascontiguousarray(difference)
        _turned_squares(turn, difference, axes_of(d), axes_of(k), rows)
        return np.asarray(0.5 * self.lame * rows[0] + self.shear * rows[1])


@dataclass(frozen=True)
class NeoHookean(Corotated):
    """½μ(‖F‖² − d) + H(J) with the moduli of Hooke's law at rest; see `reference.law`.

    Parameters
    ----------
    stable : bool
        Whether H = −μ (J − 1) + ½(λ + μ)(J − 1)², and not −μ ln J + ½λ ln² J.
    """

    stable: bool = False

    def energy_density(self, gradient: Array) -> Array:
        """Compute ½μ(‖F‖² − d) + H(J) (n,) in J/m³; infinite where ln J is not defined."""
        square = np.einsum("nij,nij->n", gradient, gradient)
        trace, away = np.einsum("nii->n", gradient), _volume_change(gradient)
        # ½μ(‖F‖² − d) − μ (J − 1), without cancellation at rest
        shape = self.shear * (0.5 * square - (away - trace))
        if self.stable:
            return np.asarray(shape + 0.5 * (self.lame + self.shear) * away**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            log = np.log1p(away)
            density = shape + self.shear * (away - log) + 0.5 * self.lame * log**2
        return np.where(away > -1.0, density, np.inf)

    def piola(self, gradient: Array) -> Array:
        """Compute the first Piola-Kirchhoff stress P = μ F + H′(J) cof F (n, d, d), Pa."""
        J = 1.0 + _volume_change(gradient)
        if self.stable:
            slope = (self.lame + self.shear) * (J - 1.0) - self.shear
        else:
            with np.errstate(invalid="ignore", divide="ignore"):
                slope = (self.lame * np.log(J) - self.shear) / J
        F = np.eye(gradient.shape[1]) + gradient
        stress = np.reshape(self.shear, (-1, 1, 1)) * F
        return np.asarray(stress + slope[:, None, None] * _cofactors(F))


Law = Hooke | Corotated | NeoHookean
_made: dict[int, tuple[Law, tuple[Array, Array, Array]]] = {}


def _of_expected(law: Corotated, expected: Array) -> tuple[Array, Array, Array]:
    """Give rotations, energy density, and squares of the entries, of gradients that are kept.

    Several solvers are held against the same array of a reference. Its results are kept as long as
    it lives, unless materials differ by region.
    """
    key = id(expected)
    if key in _made and _made[key][0] is law:
        return _made[key][1]
    found = _rotations(expected), law.energy_density(expected), squares(expected)
    if np.ndim(law.lame) == 0:
        if key not in _made:
            finalize(expected, _made.pop, key)
        _made[key] = law, found
    return found


def hooke(material: Material) -> Hooke:
    """Make Hooke's law of a scene's material."""
    return Hooke(*_given(material))


def corotated(material: Material) -> Corotated:
    """Make the corotated law of a scene's material."""
    return Corotated(*_given(material))


def law_of(scene: Scene) -> Law:
    """Choose the law of elasticity of a scene."""
    material, is_solid = scene.material, scene.cell_dimension == scene.dimension
    if is_solid and material.model != "hooke":
        return NeoHookean(*_given(material), stable=material.model == "stable_neo_hookean")
    turns = scene.analysis.kinematics == "corotational" or not is_solid
    return (corotated if turns else hooke)(material)


def _given(material: Material) -> tuple[float, float, Material | None]:
    return *_constants(material), None if material.is_uniform else material


def _constants(material: Material) -> tuple[float, float]:
    """Return λ and μ; in plane stress the λ of a thickness that gives way.

    That λ is the same in both energies: each is quadratic in its strain measure.
    """
    shear = material.young / (2 * (1 + material.poisson))
    lame = 2 * shear * material.poisson / (1 - 2 * material.poisson)
    if material.plane == "stress" or material.thickness is not None:
        lame = 2 * lame * shear / (lame + 2 * shear)
    thickness = material.thickness or 1.0
    return thickness * lame, thickness * shear


def _stretches_less_one(gradient: Array) -> Array:
    """Compute principal stretches (n, k) less one; the smallest of inverted material is negative.

    With a sum and a difference from the gradient itself in the plane, and from C − I, not from
    C, in space: 1 is never added to a small strain before it counts.
    """
    if gradient.shape[1] == 2:
        (a, b), (c, e) = gradient[:, 0].T, gradient[:, 1].T
        # σ₁ ± σ₂ = |F ± cof F|; hypot(2 + s, t) − 2 without cancellation
        s, t = a + e, c - b
        total = (s * (4.0 + s) + t * t) / (np.hypot(2.0 + s, t) + 2.0)
        apart = np.hypot(a - e, b + c)
        return 0.5 * np.column_stack([total - apart, total + apart])
    return _less_one(np.linalg.eigvalsh(_excess(gradient)), gradient)


def _excess(gradient: Array) -> Array:
    """Compute C − I (n, k, k) of displacement gradients (n, d, k)."""
    along = gradient[:, : gradient.shape[2]]
    return np.asarray(along + along.swapaxes(1, 2) + gradient.swapaxes(1, 2) @ gradient)


def _less_one(excess: Array, gradient: Array) -> Array:
    """Compute stretches less one of ascending eigenvalues (n, k) of C − I."""
    excess = np.maximum(excess, -1.0)
    found: Array = excess / (1.0 + np.sqrt(1.0 + excess))
    if gradient.shape[1] == gradient.shape[2]:
        inverted = determinants(np.eye(gradient.shape[1]) + gradient) < 0.0
        found[inverted, 0] = -2.0 - found[inverted, 0]
    return found


def _volume_change(gradient: Array) -> Array:
    """Compute J − 1 (n,) of displacement gradients (n, d, d), without adding 1 first."""
    trace = np.einsum("nii->n", gradient)
    minors = 0.5 * (trace**2 - np.einsum("nij,nji->n", gradient, gradient))
    change = trace + minors
    return change if gradient.shape[1] == 2 else change + determinants(gradient)


def _cofactors(F: Array) -> Array:
    """Compute cofactors of F (n, d, d)."""
    if F.shape[1] == 2:
        return np.asarray(F[:, ::-1, ::-1] * [[1.0, -1.0], [-1.0, 1.0]])
    a, b, c = (F[:, k] for k in range(3))
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _rotations(gradient: Array) -> Array:
    """Compute proper rotations R (n, d, k) of the polar decomposition of I + gradient."""
    deformation = np.eye(*gradient.shape[1:]) + gradient
    if gradient.shape[1] == 2:
        angle = np.arctan2(
            deformation[:, 1, 0] - deformation[:, 0, 1], deformation[:, 0, 0] + deformation[:, 1, 1]
        )
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    turned, rest = np.empty(deformation.shape), np.ones(len(deformation), dtype=bool)
    if COMPILED and gradient.shape[2] == 3:
        _polar(deformation, turned, rest)
    elif gradient.shape[2] == 3:
        for begin in range(0, len(deformation), _AT_ONCE):
            here = slice(begin, begin + _AT_ONCE)
            turned[here], rest[here] = _by_newton(deformation[here])
    left, _, right = np.linalg.svd(deformation[rest], full_matrices=False)
    if gradient.shape[2] == 3:
        left[:, :, -1] *= np.sign(determinants(left @ right))[:, None]
    turned[rest] = left @ right
    return turned


def _by_newton(F: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Compute the polar factors (n, 3, 3) of F, and whether they are left to another way (n,).

    Newton's method (Higham, SIAM J. Sci. Stat. Comput. 7, 1986) squares the distance in each step;
    it is several times as fast as a singular value decomposition where stretches are near one.
    """
    A = np.ascontiguousarray(np.moveaxis(F, 0, -1))
    cofactors, found = np.empty(A.shape), np.zeros(len(F), dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(_NEWTON_STEPS):
            for i, j in np.ndindex(3, 3):
                cofactors[i, j] = A[i - 2, j - 2] * A[i - 1, j - 1]
                cofactors[i, j] -= A[i - 2, j - 1] * A[i - 1, j - 2]
            volume = (A[0] * cofactors[0]).sum(axis=0)  # its sign stays
            step = 0.5 * (cofactors / volume - A)
            A += step
            found = (np.abs(step).max(axis=(0, 1)) <= _SETTLED) & (volume > 0.0)
            if found.all():
                break
    return np.moveaxis(A, -1, 0), ~found


@njit(cache=True)
def _polar(F, turned, rest):
    """Do as `_by_newton`, one matrix after the other."""
    cofactors = np.empty((3, 3))
    for n in range(len(F)):
        A = turned[n]
        A[:] = F[n]
        for _ in range(_NEWTON_STEPS):
            for i in range(3):
                for j in range(3):
                    cofactors[i, j] = A[i - 2, j - 2] * A[i - 1, j - 1]
                    cofactors[i, j] -= A[i - 2, j - 1] * A[i - 1, j - 2]
            volume = 0.0
            for j in range(3):
                volume += A[0, j] * cofactors[0, j]
            if not volume > 0.0:  # its sign stays
                break
            largest = 0.0
            for i in range(3):
                for j in range(3):
                    step = 0.5 * (cofactors[i, j] / volume - A[i, j])
                    A[i, j] += step
                    largest = max(largest, abs(step))
            if largest <= _SETTLED:
                rest[n] = False
                break


@njit(cache=True)
def _turned_squares(turn, difference, axes, along, rows):
    """Find tr² ε and ε : ε of ε = sym RᵀG of rotations R and gradients G (n, d, k)."""
    for n in range(len(turn)):
        trace = square = 0.0
        for i in along:
            for j in range(i + 1):
                one = other = 0.0
                for a in axes:
                    one += turn[n, a, i] * difference[n, a, j]
                    other += turn[n, a, j] * difference[n, a, i]
                square += one**2 if i == j else 0.5 * (one + other) ** 2
                trace += one if i == j else 0.0
        rows[0, n], rows[1, n] = trace**2, square


def strain_and_stress(field: SolutionField, scene: Scene) -> tuple[Array, Array]:
    """Evaluate strain (m, 3, 3) and stress (m, 3, 3) in Pa at the centres of a solution's cells.

    In linear cells they are uniform. A cell without volume has none: zero.
    """
    centres = field.shape.corners.mean(axis=1)
    gradient = field.cell_gradients(centres)
    membrane = scene.cell_dimension < scene.dimension
    frames = triangle_frames(field.shape.corners) if membrane else None
    if frames is not None:
        gradient = in_frames(gradient, frames)
    if membrane or scene.analysis.kinematics == "corotational":
        own = _biot_strain(gradient)
    else:
        own = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    moduli, k = scene.material.at(centres), scene.cell_dimension
    strain = np.zeros((len(centres), 3, 3))
    strain[:, :k, :k] = own
    if membrane or scene.material.plane == "stress":
        trace = np.einsum("nii->n", own)
        strain[:, 2, 2] = -moduli.poisson / (1.0 - moduli.poisson) * trace
    if frames is not None:
        strain = np.swapaxes(frames, 1, 2) @ strain @ frames
    shear = moduli.young / (2.0 * (1.0 + moduli.poisson))
    lame = 2.0 * shear * moduli.poisson / (1.0 - 2.0 * moduli.poisson)
    law, model = Hooke(lame, shear), scene.material.model
    if model != "hooke":
        law = NeoHookean(lame, shear, stable=model == "stable_neo_hookean")
    return strain, law.piola(strain)  # of a pure stretch Biot's


def _biot_strain(gradient: Array) -> Array:
    """Compute U − I (n, k, k) of displacement gradients (n, d, k) from C − I, without adding 1.

    The smallest stretch of a cell that is inside out is negative, as in the energy.
    """
    excess, axes = np.linalg.eigh(_excess(gradient))
    return np.asarray(np.einsum("nik,nk,njk->nij", axes, _less_one(excess, gradient), axes))


Density = float | Array
# points per direction where the density is no polynomial of the gradient
_FINE = 4


def strain_energy(solution: Solution, law: Law, step: int = -1) -> float:
    """Compute the energy of the cells of the solution, J (2D: per metre), exact for its field.

    It needs no reference and no neutral quadrature: it is a functional of the field. Only the
    corotated energy of a quadratic field is no polynomial: there the rule is of degree 7. A cell
    across an interface of materials is integrated by that rule too, each point in its own.
    """
    return float(cell_strain_energies(SolutionField(solution, step), law).sum())


def cell_strain_energies(field: SolutionField, law: Law) -> NDArray[np.float64]:
    """Compute the energy (m,) of each cell of a solution's field, J (2D: per metre)."""
    return _integrated(field, lambda at, gradient: law.at(at).energy_density(gradient(field)), law)


def stress_power(rate: SolutionField, displacement: SolutionField, law: Law) -> float:
    """Compute power of the stresses of a displacement on a velocity, ∫ P:∇w, W (2D: per metre)."""

    def density(at: Array, gradient: Callable[[SolutionField], Array]) -> Array:
        return np.einsum("nij,nij->n", law.at(at).piola(gradient(displacement)), gradient(rate))

    return float(_integrated(rate, density, law).sum())


def viscous_power(
    rate: SolutionField, velocity: SolutionField, displacement: SolutionField, law: Law
) -> float:
    """Compute w·Kv of two velocities, of which `cell_dissipation` has the square."""
    total = velocity.nodal + rate.nodal, velocity.nodal - rate.nodal
    more, less = (cell_dissipation(rate.with_nodal(v), displacement, law).sum() for v in total)
    return 0.25 * float(more - less)


def cell_dissipation(
    velocity: SolutionField, displacement: SolutionField, law: Law
) -> NDArray[np.float64]:
    """Compute v·Kv (m,) of each cell, J/s² (2D: per metre), K turned with the body.

    Twice the linear energy of the velocity gradient in the frame of the displacement: the power of
    damping proportional to the stiffness, over its factor.
    """

    def density(at: Array, gradient: Callable[[SolutionField], Array]) -> Array:
        return 2.0 * law.at(at).error_density(gradient(velocity), gradient(displacement))

    return _integrated(velocity, density, law)


def _integrated(
    field: SolutionField,
    density: Callable[[Array, Callable[[SolutionField], Array]], Array],
    law: Law,
) -> NDArray[np.float64]:
    """Integrate over each cell a density of points and of gradients of fields there."""
    solution, shape = field.solution, field.shape
    order = 1 if solution.order == 1 else _FINE if isinstance(law, Corotated) else 2
    found = np.zeros(len(solution.cells))
    membrane = solution.cell_dimension < solution.dimension
    frames = triangle_frames(shape.corners) if membrane else None
    for points, measure in _points_of_cells(field, order):

        def gradient(of: SolutionField, points: Array = points) -> Array:
            value = of.cell_gradients(points)
            return value if frames is None else in_frames(value, frames)

        found += measure * density(points, gradient)
    return found


def _points_of_cells(field: SolutionField, order: int) -> Iterator[tuple[Array, Array]]:
    """Yield a point (m, d) in each cell and the measure (m,) that it stands for."""
    shape = field.shape
    rule = simplex_rule(field.solution.cell_dimension, order)
    for weights, share in zip(*rule, strict=True):
        yield np.einsum("k,mka->ma", weights, shape.corners), share * shape.volume


def field_strain_energy(field: Field, rule: Rule, law: Law) -> float:
    """Compute the energy of the body by quadrature, J (2D: per metre); for exact fields."""
    return float(rule.weights @ law.at(rule.points).energy_density(rule.gradient(field)))


_ORDER = 3  # points per direction: the exact field may be singular in a cell


def difference_energy(
    solution: Solution, step: int, exact: Any, law: Law, density: Density
) -> tuple[float, float]:
    """Compute the kinetic and strain energy of the difference at an output time, J (2D: per metre).

    Parameters
    ----------
    solution : Solution
        Of linear kinematics, with velocities; integrated over its own cells.
    step : int
        Number of the output time.
    exact : object with ``gradient`` and ``velocity``
        The field at that time.
    law : Law
    density : float or (m,) array
        kg/m³, of each cell.

    Raises
    ------
    InputError
        If the solution has no velocities.
    """
    if solution.velocity is None:
        raise InputError("the solution has no velocities")
    field = SolutionField(solution, step)
    moving = field.with_nodal(solution.velocity[step])
    every = np.arange(len(solution.cells))
    near = field.shape.corners.mean(axis=1)
    kinetic = strain = 0.0
    for points, measure in _points_of_cells(field, _ORDER):
        off = field.in_cells(points, every)[1] - exact.gradient(points, near)
        strain += float(measure @ law.at(points).energy_density(off))
        slip = moving.in_cells(points, every)[0] - exact.velocity(points, near)
        kinetic += 0.5 * float((density * measure) @ np.sum(slip**2, axis=1))
    return kinetic, strain


def short_wave_energy(solution: Solution, period: float, density: Density) -> float:
    """Compute the kinetic energy in motions faster than a period at the end, J (2D: per metre).

    Subtract from the velocity its mean over the last period. Subtract the mean of the result over
    each part of the body, which falls or swings as a whole. The energy of the rest is averaged over
    the period. A motion of that period, or of a whole fraction of it, counts in full. One of a
    period P times longer counts by about (π/P)²/3.

    Raises
    ------
    InputError
        If there are no velocities, or less than four output times in a period, or no whole one.
    """
    times = solution.times
    if solution.velocity is None:
        raise InputError("the solution has no velocities")
    last = np.flatnonzero(times > times[-1] - period * (1 + 1e-9))
    if len(last) < 5 or last[0] == 0:
        apart = float(np.diff(times).max(initial=0.0))
        raise InputError(
            f"output times are {apart:.3g} s apart; motions of periods up to {period:.3g} s need a "
            f"quarter of that"
        )
    last = last[1:] if times[last[0]] <= times[-1] - period * (1 - 1e-9) else last
    velocity = solution.velocity[last]
    fast = velocity - velocity.mean(axis=0)
    field, energy = SolutionField(solution), 0.0
    every, parts = np.arange(len(solution.cells)), separated_parts(solution, density)
    momenta = np.zeros((len(parts), *fast.shape[::2]))
    order = 2 if solution.order == 1 else 3
    for points, measure in _points_of_cells(field, order):
        weights = density * measure
        for k, one in enumerate(fast):
            slip = field.with_nodal(one).in_cells(points, every)[0]
            energy += 0.5 * float(weights @ np.sum(slip**2, axis=1))
            for part, momentum in zip(parts, momenta, strict=True):
                momentum[k] += weights[part.cells] @ slip[part.cells]
    for part, momentum in zip(parts, momenta, strict=True):
        energy -= 0.5 * float(np.sum(momentum**2)) / part.mass
    return energy / len(fast)
