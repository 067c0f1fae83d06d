"""A penny-shaped crack in infinite space, pulled, sheared, and with a pressure in it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact.field import Hooke, Parameters
from reference.exact.solution import Array, ExactSolution, matrices, plane_axes
from verify.errors import InputError
from verify.scene import Scene

_AXIS = 1e-9  # of the radius: closer to the axis a point is on it


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

    What opens it (I. N. Sneddon, Proc. R. Soc. Lond. A 187, 1946): around the axis, with z along
    it, 2μ u_r = B [(1−2ν) f_r + z f_rz], 2μ u_z = B [−2(1−ν) f_z + z f_zz], B = 2Na²/3π for a
    pull N. What shears it along x by T (M. K. Kassir & G. C. Sih, J. Appl. Mech. 33, 1966):
    2μ u_x = C [−2(1−ν) f_z + z f_xx], 2μ u_y = C z f_xy, 2μ u_z = C [−(1−2ν) f_x + z f_xz],
    C = 4Ta²/(3π(2−ν)), u_x and u_y odd in z. The function f is harmonic; in oblate coordinates
    z = aζm, r² = a²(1+ζ²)(1−m²) its derivatives are elementary, with r² + (z+ia)² = R²,
    R = a(ζ+im). To both comes the field of the uniform remote stress.

    Parameters ``centre`` (m, default the origin), ``normal`` of the crack (default z), radius
    ``a`` (m), remote ``tension`` across the crack (Pa) or in its place the remote ``stress``
    (3 × 3, Pa, in the axes of the scene), and the ``pressure`` on the faces (Pa, default 0).
    Faces that are not pulled open overlap.
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
        """Displacement (n, 3), m; see `ExactSolution`."""
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
        """Displacement gradient (n, 3, 3), nan at the front. See `ExactSolution`."""
        s, z, upper, f = self._evaluate(points, near)
        # on the axis 0/0, and at the front ∞ − ∞: the limit depends on the way there
        with np.errstate(divide="ignore", invalid="ignore"):
            local = self._opens * self._opening(s, z, upper, f)
            if self._slides > 0.0:
                local += self._slides * self._shearing(s, z, upper, f)
            turned: Array = self._axes.T @ (local + self._strain) @ self._axes
        return turned

    def _opening(self, s: Array, z: Array, upper: Array, f: _Derivatives) -> Array:
        """Gradient of what a pull opens, of B = 2μ."""
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
        """Gradient of what a shear along x slides, of C = 2μ."""
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
