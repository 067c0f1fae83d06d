"""Bases of exact solutions: a field known at every point, its law, parameters and stored energy.

Energies are integrals over facets of the body (edges of a polygon, faces of a box), or over cones
from a point to them. Where a cut plane goes through, they run over the parts on either side. Each
part takes the field of its side, which is smooth beyond the cut.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.planar import polygon_area
from verify.geometry.simplices import frame, unit_rule
from verify.scene import Box, Material, Polygon, Rectangle, Scene
from verify.scene.strict import nearest

_SHAPES = {
    (): "a number",
    (2,): "two numbers",
    (3,): "three numbers",
    (2, 2): "two rows of two numbers",
    (2, 3): "two rows of three numbers",
    (3, 3): "three rows of three numbers",
    (3, 4): "three rows of four numbers",
}
Array = NDArray[np.float64]
Plane = tuple[Array, Array]
_Part = tuple[Array, Array | None]  # of a facet: corners (k, d), and the way (d,) to its side
_Density = Callable[[Array], Array]
_ORDERS = (12, 20, 32, 48, 80)
_AGREE = 1e-11  # of the energy: two orders
_TOLERANCE = 1e-13  # of ∫ |t| |u|
_HALVINGS = 60
_MOST_PANELS = 20000
_INWARD = 1e-7  # of the body's size: how far inside the outline `near` is
Above = NDArray[np.bool_]


@dataclass(frozen=True)
class Hooke:
    """Hooke's law, in the plane or in space.

    In plane stress `lame` is the λ of the plane law, 2λμ/(λ+2μ), so that one set of formulas serves
    both states.

    Parameters
    ----------
    lame : float
        First Lamé constant λ, Pa.
    shear : float
        Shear modulus μ, Pa.
    dimension : {2, 3}
    density : float, optional
        kg/m³; what moves needs it.
    model : str
        Energy at finite rotation, as in case files; the formulas here are Hooke's.
    """

    lame: float
    shear: float
    dimension: int
    density: float | None = None
    model: str = "hooke"

    @property
    def eta(self) -> float:
        """η = λ/(λ+2μ): lateral contraction that keeps a plane free of normal stress."""
        return self.lame / (self.lame + 2 * self.shear)

    @property
    def plane_modulus(self) -> float:
        """E' = 4μ(λ+μ)/(λ+2μ): E/(1−ν²) in plane strain, E in plane stress, Pa."""
        lame, shear = self.lame, self.shear
        return 4 * shear * (lame + shear) / (lame + 2 * shear)

    @property
    def kolosov(self) -> float:
        """κ = (λ+3μ)/(λ+μ): 3−4ν in plane strain, (3−ν)/(1+ν) in plane stress."""
        return (self.lame + 3 * self.shear) / (self.lame + self.shear)

    def stress(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the stress (…, d, d) in Pa of displacement gradients (…, d, d)."""
        strain = 0.5 * (gradient + gradient.swapaxes(-1, -2))
        trace = np.trace(strain, axis1=-2, axis2=-1)
        stress: NDArray[np.float64] = 2 * self.shear * strain
        stress += self.lame * trace[..., None, None] * np.eye(self.dimension)
        return stress


def hooke(material: Material) -> Hooke:
    """Compute Hooke's law of a scene's material; in space where it names no plane state."""
    young, poisson = material.young, material.poisson
    shear = young / (2 * (1 + poisson))
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    if material.plane == "stress":
        lame = young * poisson / (1 - poisson**2)
    dimension = 3 if material.plane is None else 2
    return Hooke(lame, shear, dimension, material.density, material.model)


class Parameters:
    """What the case file says, until it has all been taken.

    Parameters
    ----------
    solution : str
        Name of the exact solution, for messages.
    given : mapping
        The parameters.
    """

    def __init__(self, solution: str, given: Mapping[str, Any]) -> None:
        self._solution = solution
        self._given = dict(given)
        self._known: list[str] = []
        self._missing: list[str] = []

    def has(self, name: str) -> bool:
        """Tell whether `name` is given."""
        self._known.append(name)
        return name in self._given

    def take(self, name: str, *shapes: tuple[int, ...], default: Any = None) -> NDArray[np.float64]:
        """Take the parameter `name`, which must have one of `shapes`.

        Raises
        ------
        InputError
            If it is not finite numbers of that shape. `close` reports parameters that are missing
            without a `default`.
        """
        self._known.append(name)
        if name not in self._given:
            if default is None:
                self._missing.append(f"parameters.{name} is missing; expected {_words(shapes)}")
                return np.full(shapes[0], 1.0)  # `close` refuses it
            return np.asarray(default, dtype=float)
        try:
            value = np.asarray(self._given[name], dtype=float)
        except (TypeError, ValueError):
            value = np.array([np.nan] * 99)
        if value.shape not in shapes or not np.isfinite(value).all():
            raise InputError(
                f"parameters.{name} = {self._given[name]}; '{self._solution}' expects "
                f"{_words(shapes)}"
            )
        return value

    def positive(self, name: str) -> float:
        """Take the positive number `name`."""
        value = float(self.take(name, ()))
        if value <= 0.0:
            raise InputError(f"parameters.{name} = {value:g}; expected a positive number")
        return value

    def close(self) -> None:
        """Say that all has been taken.

        Raises
        ------
        InputError
            If something is left that the solution does not know, or something was missing.
        """
        # unknown names first: a misspelt name explains the one that is missing
        for name in self._given:
            if name not in self._known:
                hint = nearest(name, self._known)
                raise InputError(f"'{self._solution}' has no parameter '{name}'{hint}")
        if self._missing:
            raise InputError(self._missing[0])


def _words(shapes: tuple[tuple[int, ...], ...]) -> str:
    return " or ".join(_SHAPES[shape] for shape in shapes)


class ExactField(ABC):
    """A displacement field that solves the equations of linear elasticity exactly.

    Points are (n, d) arrays in metres. `near` (n, d) are points on the wanted side of the cut,
    close to `points`: a point on the cut, or off it by round-off, belongs to the side on which
    its `near` lies. Without `near` a point on the cut belongs to the positive (left) side.

    A field that moves says so (`moves`), gives itself at another time (`at`) and has velocities;
    as it is made it is the field at the time 0. It solves the equations of motion: its
    `body_force` balances stress and inertia.

    Parameters
    ----------
    law : Hooke
    """

    has_body_force: bool = False
    moves: bool = False
    time: float = 0.0  # s, of a field that moves

    def __init__(self, law: Hooke) -> None:
        self.law = law

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return self.law.dimension

    @property
    def singular_points(self) -> Array:
        """Points (k, d) near which derivatives are unbounded."""
        return np.zeros((0, self.dimension))

    @property
    def cut_plane(self) -> Plane | None:
        """Point and normal of the line or plane through the body across which the field jumps.

        None if there is none. It is smooth on either side, and the field of a side beyond it.
        """
        return None

    def at(self, time: float) -> Self:
        """Return the field at a time, s: itself, if it stands still."""
        if not self.moves:
            return self
        other = copy(self)
        other.time = float(time)
        return other

    @abstractmethod
    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d), m."""

    @abstractmethod
    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d): entry i, j is ∂u_i/∂x_j."""

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Compute the velocity (n, d), m/s: zero, if it stands still."""
        return np.zeros_like(points, dtype=float)

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Force per volume (n, d), N/m³, that keeps the field in equilibrium."""
        return np.zeros_like(points, dtype=float)

    def stress(self, points: Array, near: Array | None = None) -> Array:
        """Compute the stress (n, d, d), Pa."""
        return self.law.stress(self.gradient(points, near))

    def smooth(self, points: Array, reach: Array | float) -> NDArray[np.bool_]:
        """Whether (n,) stress is smooth within a distance of points, m: no front of a wave is."""
        return np.ones(len(points), dtype=bool)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Compute parameters in (0, 1) at which field jumps on the segment from `start` to `end`.

        In the plane; not across `cut_plane`.
        """
        return []


class ExactSolution(ExactField):
    """An exact field whose strain energy in a body is computed to round-off; see `ExactField`."""

    def strain_energy(self, body: Array | Scene) -> float:
        """Compute the strain energy of a body, J (in the plane per metre of thickness), to 1e-11.

        Half the work of the tractions on the surface; with a body force, or a plane cut through
        the body in space, half the integral of stress times strain.

        Parameters
        ----------
        body : array or Scene
            In the plane: corners (k, 2) in order, or a scene whose geometry is a rectangle or
            polygon. In space: both corners (2, 3) of a box, or a scene with one.

        Raises
        ------
        InputError
            If the field moves: the tractions on the surface do not say it.
        """
        if self.moves:
            raise InputError("the strain energy of a moving field is no work on the surface")
        if self.dimension == 2:
            outline = outline_of(body)
            facets = list(np.stack([outline, np.roll(outline, -1, axis=0)], axis=1))
            if not self.has_body_force:
                return _work_on_outline(self, facets)
        else:
            facets = _faces(box_of(body))
            if not self.has_body_force and self.cut_plane is None:
                return _work_on_faces(self, facets)
        return _energy_inside(self, facets)


def outline_of(body: Array | Scene) -> Array:
    """Find corners (k, 2) of a polygonal body, counter-clockwise.

    Raises
    ------
    InputError
        If the body is not a rectangle or a polygon.
    """
    if isinstance(body, Scene):
        if not isinstance(body.geometry, Rectangle | Polygon):
            raise InputError(
                f"exact strain energy of a geometry of kind '{body.geometry.kind}'; "
                "expected rectangle or polygon"
            )
        body = body.geometry.outline()
    corners = np.asarray(body, dtype=float)
    return corners if polygon_area(corners) > 0 else corners[::-1]


def box_of(body: Array | Scene) -> Array:
    """Lower and upper corner (2, 3) of a box.

    Raises
    ------
    InputError
        If the body is not a box.
    """
    if isinstance(body, Scene):
        if not isinstance(body.geometry, Box):
            raise InputError(
                f"exact strain energy of a geometry of kind '{body.geometry.kind}'; expected box"
            )
        return np.array([body.geometry.lower, body.geometry.upper], dtype=float)
    corners = np.asarray(body, dtype=float)
    if corners.shape != (2, 3):
        raise InputError(f"a box of shape {corners.shape}; expected its two corners, (2, 3)")
    return corners


def _faces(corners: Array) -> list[Array]:
    """Return faces (4, 3) of a box, anticlockwise seen from outside."""
    faces = []
    for axis, side in product(range(3), (0, 1)):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        ring = [(0, 0), (1, 0), (1, 1), (0, 1)] if side else [(0, 0), (0, 1), (1, 1), (1, 0)]
        quad = np.empty((4, 3))
        quad[:, axis] = corners[side, axis]
        quad[:, b] = [corners[i, b] for i, _ in ring]
        quad[:, c] = [corners[j, c] for _, j in ring]
        faces.append(quad)
    return faces


def _parts(field: ExactField, facets: list[Array]) -> list[_Part]:
    """Divide facets at the cut plane of a field."""
    if field.cut_plane is None:
        return [(facet, None) for facet in facets]
    origin, normal = field.cut_plane
    corners = np.concatenate(facets)
    beyond = 10 * np.ptp(corners, axis=0).max() + np.abs((corners - origin) @ normal).max()
    parts = []
    for facet, sign in product(facets, (1.0, -1.0)):
        part = _above(facet, sign * ((facet - origin) @ normal))
        if len(part) >= field.dimension:
            parts.append((part, sign * beyond * normal))
    return parts


def _above(corners: Array, height: Array) -> Array:
    """Part (k, d) of a segment or a convex polygon with height ≥ 0."""
    kept = []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if height[i] >= 0:
            kept.append(corners[i])
        if height[i] * height[j] < 0:
            share = height[i] / (height[i] - height[j])
            kept.append(corners[i] + share * (corners[j] - corners[i]))
    # a segment is walked along there and back
    return np.array(kept[:2] if len(corners) == 2 else kept).reshape(-1, corners.shape[1])


def _energy_inside(field: ExactField, facets: list[Array]) -> float:
    """Compute half the integral of stress times strain, J: over cones over the facets, signed.

    They meet at a point of the cut plane, which has no volume below it.
    """
    apex = np.mean(np.concatenate(facets), axis=0)
    if field.cut_plane is not None:
        origin, normal = field.cut_plane
        apex = apex - ((apex - origin) @ normal) * normal
    cones = [
        (np.stack([part[0], *part[k : k + field.dimension - 1]]) - apex, side)
        for part, side in _parts(field, facets)
        for k in range(1, len(part) - field.dimension + 2)
    ]

    def energy(order: int) -> float:
        shares, weights = _simplex_rule(order, field.dimension)
        total = 0.0
        for edges, side in cones:
            points = apex + shares @ edges
            gradient = field.gradient(points, None if side is None else points + side)
            density = 0.5 * np.sum(field.law.stress(gradient) * gradient, axis=(1, 2))
            total += float(np.linalg.det(edges)) * float(density @ weights)
        return total

    return _settled(energy, "over the body")


def _work_on_faces(field: ExactField, faces: list[Array]) -> float:
    """Half the work of the tractions on the faces of a box, J, where the field is smooth there."""

    def work(order: int) -> float:
        x, w = unit_rule(order)
        total = 0.0
        for quad in faces:
            u, v = quad[1] - quad[0], quad[3] - quad[0]
            points = quad[0] + np.repeat(x, order)[:, None] * u + np.tile(x, order)[:, None] * v
            traction = field.stress(points) @ np.cross(u, v)
            density = np.sum(traction * field.displacement(points), axis=1)
            total += 0.5 * float(density @ np.outer(w, w).ravel())
        return total

    return _settled(work, "on the surface of the body", " (does the crack reach it?)")


def _settled(integral: Callable[[int], float], where: str, hint: str = "") -> float:
    """Raise the order of an integral until two agree."""
    known = None
    for order in _ORDERS:
        value = integral(order)
        if known is not None and abs(value - known) <= _AGREE * abs(value):
            return value
        known = value
    text = f"the exact solution varies too quickly {where} for its energy to be integrated{hint}"
    raise InputError(text)


def _simplex_rule(order: int, d: int) -> tuple[Array, Array]:
    """Compute barycentric points (k, d) of all corners but first, and weights (k,), of volume 1/d!.

    The cube collapsed onto the simplex.
    """
    x, w = unit_rule(order)
    steps = np.cumprod([g.ravel() for g in np.meshgrid(*[x] * d, indexing="ij")], axis=0)
    weights = np.meshgrid(*[w * x ** (d - 1 - i) for i in range(d)], indexing="ij")
    shares = steps - np.vstack([steps[1:], np.zeros(steps.shape[1])])
    return shares.T, np.prod(weights, axis=0).ravel()


def _work_on_outline(field: ExactField, edges: list[Array]) -> float:
    """Compute half the work of the tractions on a closed polygon (counter-clockwise), J/m.

    Faces of cuts are free of traction in all solutions here and do no work.
    """
    inside = _INWARD * float(np.ptp(np.concatenate(edges), axis=0).max())
    densities = []
    for (a, b), side in _parts(field, edges):
        for start, end in pairwise([0.0, *sorted(field.kinks(a, b)), 1.0]):
            p, q = a + start * (b - a), a + end * (b - a)
            if (p != q).any():
                densities.append(_work_density(field, p, q, inside, side))
    panels = np.linspace(0.0, 1.0, 9)
    scale = sum(float(_gauss(bound, panels[:-1], panels[1:]).sum()) for _, bound in densities)
    return 0.5 * sum(_adaptive(work, panels, _TOLERANCE * scale) for work, _ in densities)


def _work_density(
    field: ExactField, a: Array, b: Array, inside: float, side: Array | None
) -> tuple[_Density, _Density]:
    """Give t·u and |t| |u| along the edge from a to b as functions of its parameter in [0, 1].

    The second sets the tolerance: where t·u cancels to zero it leaves its round-off behind.
    """
    length = float(np.linalg.norm(b - a))
    normal = np.array([b[1] - a[1], a[0] - b[0]]) / length
    inward = -inside * normal if side is None else side

    def both(t: Array) -> tuple[Array, Array]:
        points = a + t[:, None] * (b - a)
        near = points + inward
        return field.stress(points, near) @ normal, field.displacement(points, near)

    def work(t: Array) -> Array:
        traction, u = both(t)
        return length * np.asarray(np.sum(traction * u, axis=1))

    def bound(t: Array) -> Array:
        traction, u = both(t)
        return length * np.asarray(np.linalg.norm(traction, axis=1) * np.linalg.norm(u, axis=1))

    return work, bound


def _adaptive(density: _Density, panels: Array, tolerance: float) -> float:
    """∫ density over [0, 1]: Gauss points on panels that are halved until two sums agree."""
    starts, ends = panels[:-1], panels[1:]
    coarse = _gauss(density, starts, ends)
    total = 0.0
    for _ in range(_HALVINGS):
        middles = 0.5 * (starts + ends)
        left, right = _gauss(density, starts, middles), _gauss(density, middles, ends)
        settled = np.abs(left + right - coarse) <= tolerance
        total += float((left + right)[settled].sum())
        if settled.all():
            break
        coarse = np.concatenate([left[~settled], right[~settled]])
        starts, ends = (
            np.concatenate([starts[~settled], middles[~settled]]),
            np.concatenate([middles[~settled], ends[~settled]]),
        )
        if len(starts) > _MOST_PANELS:
            raise InputError("the exact solution varies too quickly along the outline")
    else:
        total += float(coarse.sum())  # around a tip on the outline, 2⁻⁶⁰ of an edge
    return total


def _gauss(density: _Density, starts: Array, ends: Array) -> Array:
    nodes, weights = unit_rule(16)
    t = starts[:, None] + (ends - starts)[:, None] * nodes
    values: Array = density(t.ravel()).reshape(t.shape) @ weights * (ends - starts)
    return values


def line_axes(parameters: Parameters, of: str = "") -> Array:
    """Take the direction of a line: rows along (s) and normal (t), from `slope` or `angle`.

    With `of`, the material of another body: the names of its parameters begin so.
    """
    slope, degrees = f"{of}slope", f"{of}angle"
    if parameters.has(slope) and parameters.has(degrees):
        raise InputError(f"parameters: {slope} and {degrees} are both given; expected one of them")
    if parameters.has(degrees):
        angle = np.deg2rad(float(parameters.take(degrees, ())))
    else:
        angle = np.arctan(float(parameters.take(slope, ())))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def plane_axes(parameters: Parameters) -> Array:
    """Take `normal` and `axis` (default: any): rows s1, s2 along and t normal to a plane."""
    normal = parameters.take("normal", (3,))
    size = float(np.linalg.norm(normal))
    if size == 0.0:
        raise InputError("parameters.normal is zero; expected a direction")
    axis = parameters.take("axis", (3,), default=frame(normal)[0])
    if float(np.linalg.norm(np.cross(normal / size, axis))) <= 1e-9:
        raise InputError("parameters.axis is zero or parallel to the normal")
    return frame(normal, axis)


class TwoSidedSolution(ExactSolution):
    """A field written in the axes of the cut: along it, and last t, normal to it.

    The side *above* is t > 0: in the plane, left of the direction of the cut. Every per-side
    parameter comes as above, then below.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``point`` on the cut, where the axes begin. In the plane ``slope`` or ``angle`` (degrees),
        and the ``shift`` of each side along t. In space its ``normal``, the direction ``axis`` of
        the first axis (default: any), and the ``shift`` in local axes of each side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        plane = law.dimension == 2
        self._origin = parameters.take("point", (law.dimension,))
        self._axes = line_axes(parameters) if plane else plane_axes(parameters)
        shape = (2,) if plane else (2, 3)
        shift = parameters.take("shift", shape, default=np.zeros(shape))
        self._shift = np.column_stack([np.zeros(2), shift]) if plane else shift

    @property
    def cut_plane(self) -> Plane | None:
        """The cut: a point on it and its normal."""
        return self._origin, self._axes[-1]

    @abstractmethod
    def _local_displacement(self, s: Array, above: Above) -> Array:
        """Compute the displacement (n, d) in local axes at local points (n, d)."""

    @abstractmethod
    def _local_gradient(self, s: Array, above: Above) -> Array:
        """Give the gradient (n, d, d) in local axes."""

    def _local_body_force(self, s: Array, above: Above) -> Array:
        return np.zeros_like(s)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d), m; see `ExactSolution`."""
        s, above = self._local(points, near)
        return (self._local_displacement(s, above) + side(self._shift, above)) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d); see `ExactSolution`."""
        return turned(self._local_gradient(*self._local(points, near)), self._axes)

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Compute the body force (n, d), N/m³; see `ExactSolution`."""
        return self._local_body_force(*self._local(points, near)) @ self._axes

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Above]:
        s = (np.asarray(points, dtype=float) - self._origin) @ self._axes.T
        decides = s[:, -1] if near is None else (np.asarray(near) - self._origin) @ self._axes[-1]
        return s, decides >= 0.0


def side(pair: Array, above: Above) -> Array:
    """Return values (n, …) of a per-side parameter (2, …) at points on those sides."""
    return np.asarray(pair.take(~above, axis=0))


def matrices(rows: list[list[Array]]) -> Array:
    """Compute matrices (n, d, d) from rows of entries (n,)."""
    return np.moveaxis(np.array(rows), 2, 0)


def complex_gradient(
    dz: NDArray[np.complex128], dz_bar: NDArray[np.complex128], shear: float, axes: Array
) -> Array:
    """Compute gradients (n, 2, 2) of u_x + i u_y from 2μ times its derivatives by z and z̄ (n,).

    The rows of `axes` (2, 2) are the axes of z.
    """
    along_x, along_y = (dz + dz_bar) / (2 * shear), 1j * (dz - dz_bar) / (2 * shear)
    rows = matrices([[along_x.real, along_y.real], [along_x.imag, along_y.imag]])
    return turned(rows, axes)


def turned(gradients: Array, axes: Array) -> Array:
    """Compute axesᵀ G axes of gradients (n, d, d): as one product, ten times as fast as one by one.

    The rows of `axes` (d, d) are the axes of G.
    """
    entries = gradients.reshape(len(gradients), axes.size)
    return np.asarray((entries @ np.kron(axes, axes)).reshape(gradients.shape))
