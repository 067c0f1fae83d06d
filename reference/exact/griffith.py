"""A straight crack in an infinite plate under any remote stress (Griffith's crack)."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.complex_crack import Complex, ComplexCrack, Potentials
from reference.exact.energy import outline_of
from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from verify.geometry.planar import inner_parts
from verify.scene import Scene


class Griffith(ComplexCrack):
    """φ = ½ S R + Γ z, ω = ½ S R − Γ z, with R = √(z−a) √(z+a).

    S = σ_yy − iσ_xy and Γ = (σ_xx − σ_yy)/4 + iσ_xy/2 of the remote stress in the crack's
    axes. Parameters ``centre`` (m, default the origin), half-length ``a`` (m), ``angle``
    (degrees, default 0), the remote ``stress`` (σ_xx, σ_yy, σ_xy) in the axes of the scene and
    the ``pressure`` p (Pa, default 0) on the faces: the field of free faces under the remote
    stress σ + p I, less that of the uniform stress p I.
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
        """Displacement (n, 2), m; see `ExactSolution`."""
        return super().displacement(points, near) - self._shrinkage * (points - self._origin)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 2, 2), nan at a tip. See `ExactSolution`."""
        return super().gradient(points, near) - self._shrinkage * np.eye(2)

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a body, J/m: half the work on its outline and on the faces."""
        energy = super().strain_energy(body)
        if self._pressure == 0.0:
            return energy
        # the opening is an ellipse: smooth in the angle of x = a sin θ
        nodes, weights = np.polynomial.legendre.leggauss(64)
        for start, end in inner_parts(self.singular_points, outline_of(body)):
            ends = (np.array([start, end]) - self._origin) @ self._axes[0] / self._a
            low, high = np.arcsin(np.clip(ends, -1.0, 1.0))
            angle = 0.5 * (low + high) + 0.5 * (high - low) * nodes
            points = self._origin + np.outer(self._a * np.sin(angle), self._axes[0])
            above, below = (
                self.displacement(points, points + side * self._a * self._axes[1])
                for side in (1.0, -1.0)
            )
            opening = (above - below) @ self._axes[1]
            length = 0.5 * (high - low) * self._a * np.cos(angle) * weights
            energy += 0.5 * self._pressure * float(opening @ length)
        return energy

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(np.abs(x) < self._a)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        a, s, gamma = self._a, self._s, self._gamma
        # z ∓ a by parts, which keeps a negative zero of the imaginary part
        left, right = z.copy(), z.copy()
        left.real -= a
        right.real += a
        root = sheet * np.sqrt(left) * np.sqrt(right)
        bar = root.conj()
        return Potentials(
            0.5 * s * root + gamma * z,
            0.5 * s * z / root + gamma,
            np.asarray(-0.5 * s * a**2 / root**3, dtype=complex),
            0.5 * s * bar - gamma * z.conj(),
            0.5 * s * z.conj() / bar - gamma,
        )
