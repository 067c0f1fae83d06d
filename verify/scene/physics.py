"""Material, supports, loads, their factors in time, and the analysis of a scene. SI units."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, WithJsonSchema

from verify.scene.geometry import GROUP, MeshFile
from verify.scene.regions import parse_expression, parse_region
from verify.scene.strict import (
    Components,
    Count,
    Finite,
    Formula,
    NonNegative,
    Point3,
    Positive,
    Rules,
    Strict,
    Vector,
    none_or_both,
)

Array = NDArray[np.float64]

_INWARDS = 1e-6  # of the way from a corner of a cell to its centroid
_OUTPUTS = 11
_WHERE = "name of a boundary part, 'boundary', an inequality, or 'group:NAME' of a mesh file"


class Moduli(NamedTuple):
    """Young's modulus (n,) in Pa, Poisson's ratio (n,) and density (n,) in kg/m³ at points.

    Where a scene has no density, it is not a number.
    """

    young: Array
    poisson: Array
    density: Array


class MaterialRegion(Strict):
    """A region of another material; keys that it does not give are as in ``[material]``.

    Attributes
    ----------
    where
        an inequality in x, y, z, or 'group:NAME' of a mesh file; of regions that overlap, the last
    young
        Young's modulus E, Pa
    poisson
        Poisson's ratio
    density
        density, kg/m³
    """

    where: str
    young: Positive | None = None
    poisson: float | None = Field(default=None, strict=True, gt=-1.0, lt=0.5)
    density: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", lambda r: r.young is None and r.poisson is None and r.density is None,
         "expected young, poisson or density of the region"),
    )  # fmt: skip

    _geometry: MeshFile | None = PrivateAttr(default=None)  # whose groups it names; set by a scene

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points (n, d) lie in it."""
        if self._geometry is not None and self._geometry.is_part(self.where):
            return self._geometry.body().inside(self.where.removeprefix(GROUP), points)
        return parse_region(self.where, points.shape[1])(points)


class Material(Strict):
    """Isotropic elasticity: one material, or others in regions of the body.

    Attributes
    ----------
    young
        Young's modulus E, Pa
    poisson
        Poisson's ratio
    density
        density, kg/m³
    plane
        2D only: plane strain or plane stress
    thickness
        membranes only: thickness, m
    model
        energy, of these moduli at rest: Hooke's of the strain, at finite rotation of U − I;
        neo-Hookean with ln J, or without it (finite where cells are inside out)
    regions
        other materials; what no region covers is this one
    """

    young: Positive
    poisson: float = Field(strict=True, gt=-1.0, lt=0.5)
    density: Positive | None = None
    plane: Literal["strain", "stress"] | None = None
    thickness: Positive | None = None
    model: Literal["hooke", "neo_hookean", "stable_neo_hookean"] = "hooke"
    regions: list[MaterialRegion] = Field(default_factory=list)

    @property
    def is_uniform(self) -> bool:
        """Whether the whole body is of one material."""
        return not self.regions

    @property
    def each(self) -> "list[Material]":
        """All materials, each alone: first outside the regions, then in each region."""
        base = self.model_copy(update={"regions": []})
        given = [r.model_dump(exclude={"where"}, exclude_none=True) for r in self.regions]
        return [base, *(base.model_copy(update=own) for own in given)]

    def number_at(self, points: Array) -> NDArray[np.int64]:
        """Return the number (n,) in `each` of the material at points (n, d)."""
        found = np.zeros(len(points), dtype=np.int64)
        for k, region in enumerate(self.regions):
            found[region.holds(points)] = k + 1
        return found

    def at(self, points: Array) -> Moduli:
        """Return the moduli at points (n, d)."""
        each, number = self.each, self.number_at(points)
        rows = [(m.young, m.poisson, np.nan if m.density is None else m.density) for m in each]
        return Moduli(*np.array(rows, dtype=float)[number].T)


def crossed_by_interfaces(
    material: Material, points: Array, cells: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Tell of which cells (m,) the corners do not all lie in the material of the centroid.

    Corners count just inside the cell: an interface along a facet crosses no cell.
    """
    corners = points[cells]
    middle = corners.mean(axis=1)
    own = material.number_at(middle)
    crossed = np.zeros(len(cells), dtype=bool)
    for k in range(corners.shape[1]):
        crossed |= material.number_at(corners[:, k] + _INWARDS * (middle - corners[:, k])) != own
    return crossed


def _ordered(history: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = [time for time, _ in history]
    if times != sorted(times) or any(a == b for a, b in zip(times, times[2:], strict=False)):
        raise ValueError("times must ascend; two equal ones are a jump, three are too many")
    return history


History = Annotated[
    list[tuple[NonNegative, Finite]],
    Field(
        min_length=1,
        description="dynamic: [[time in s, factor], …]; the value times the factor, linear between "
        "the times and constant before and after them; two equal times make a jump",
    ),
    AfterValidator(_ordered),
]
_Table = Sequence[tuple[float, float]] | None


def factor_at(history: _Table, time: float, before: bool = False) -> float:
    """Factor at a time, after a jump there, or before it; 1 without a history."""
    if history is None:
        return 1.0
    times, factors = np.array(history, dtype=float).T
    last = int(np.searchsorted(times, time, side="left" if before else "right"))
    if last in (0, len(times)):
        return float(factors[min(last, len(times) - 1)])
    share = (time - times[last - 1]) / (times[last] - times[last - 1])
    return float((1.0 - share) * factors[last - 1] + share * factors[last])


def slope_at(history: _Table, time: float, before: bool = False) -> float:
    """Rate of the factor at a time, 1/s; after a kink there, or before it."""
    if history is None:
        return 0.0
    times, factors = np.array(history, dtype=float).T
    last = int(np.searchsorted(times, time, side="left" if before else "right"))
    if last in (0, len(times)):
        return 0.0
    return float((factors[last] - factors[last - 1]) / (times[last] - times[last - 1]))


def knot_near(history: _Table, time: float, close: float) -> float:
    """Return the time of a history that differs from one by at most `close`, s; else that one."""
    nearest = min((t for t, _ in history or ()), key=lambda t: abs(t - time), default=time)
    return nearest if abs(nearest - time) <= close else time


def first_factor(history: _Table) -> float:
    """Factor of the initial equilibrium: the first, before a jump at the time 0."""
    return 1.0 if history is None else float(history[0][1])


def jumps(history: _Table) -> list[float]:
    """Return the times at which the factor jumps, s."""
    return [a for (a, _), (b, _) in pairwise(history or ()) if a == b]


def is_uniform(components: Sequence[float | str]) -> bool:
    """Whether all components are numbers, not formulas."""
    return not any(isinstance(one, str) for one in components)


def is_timed(components: Sequence[float | str]) -> bool:
    """Whether a formula among the components names the time."""
    # whichever coordinates it names: a scene has checked that they are its own
    return any(isinstance(one, str) and parse_expression(one, 3, True).timed for one in components)


def field_values(components: Sequence[float | str], points: Array, time: float = 0.0) -> Array:
    """Values (n, components) of numbers and formulas at points (n, d) and a time, s."""
    if is_uniform(components):
        return np.tile(np.asarray(components, dtype=float), (len(points), 1))
    columns = [
        parse_expression(one, points.shape[1], timed=True)(points, time)
        if isinstance(one, str)
        else np.full(len(points), one)
        for one in components
    ]
    return np.column_stack(columns)


def field_rates(components: Sequence[float | str], points: Array, time: float) -> Array:
    """Return the derivatives (n, components) of `field_values` by the time, 1/s."""
    rates = np.zeros((len(points), len(components)))
    for k, one in enumerate(components):
        if isinstance(one, str):
            rates[:, k] = parse_expression(one, points.shape[1], timed=True).rate(points, time)
    return rates


class Rotation(Strict):
    """A finite rotation about a point or an axis.

    Attributes
    ----------
    angle
        degrees, anticlockwise seen from the tip of the axis
    centre
        a point that it leaves where it is, m
    axis
        3D: its direction; of any length
    """

    angle: Finite
    centre: Vector
    axis: Point3 | None = None

    def matrix(self, factor: float = 1.0) -> Array:
        """Rotation matrix (d, d) of the angle times a factor."""
        angle, n = np.deg2rad(self.angle) * factor, self._spin()
        turn = np.eye(len(n)) + np.sin(angle) * n + (1.0 - np.cos(angle)) * n @ n
        return np.asarray(turn)

    def matrix_rate(self, factor: float = 1.0) -> Array:
        """Return the derivative (d, d) of the matrix by the factor."""
        return np.asarray(np.deg2rad(self.angle) * self._spin() @ self.matrix(factor))

    def _spin(self) -> Array:
        """Skew-symmetric matrix of the unit axis."""
        if self.axis is None:
            return np.array([[0.0, -1.0], [1.0, 0.0]])
        x, y, z = np.asarray(self.axis) / np.linalg.norm(self.axis)
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Support(Strict):
    """Prescribed displacement on a part of the boundary.

    Attributes
    ----------
    displacement
        m, one number or formula in x, y, z, t per component held; or 'exact' (see [exact])
    components
        which components are held; default all
    rotation
        turn the part, then move it by `displacement`
    """

    where: str = Field(description=_WHERE)
    displacement: Components | Literal["exact"]
    components: list[Literal["x", "y", "z"]] | None = None
    rotation: Rotation | None = None
    history: History | None = None

    rules: ClassVar[Rules] = (
        ("", lambda p: p.rotation is not None and (p.components or p.displacement == "exact"),
         "a rotation goes with a displacement of all components"),
        ("", lambda p: p.components is not None
         and (not p.components or len(set(p.components)) < len(p.components)) and (p.components,),
         "components {} must name each component once"),
        ("", lambda p: p.components is not None and p.displacement != "exact"
         and len(p.displacement) != len(p.components) and (len(p.displacement), p.components),
         "displacement has {} values for components {}; expected one per component"),
    )  # fmt: skip

    @property
    def timed(self) -> bool:
        """Whether a formula names the time."""
        return self.displacement != "exact" and is_timed(self.displacement)

    def held(self, dimension: int) -> tuple[int, ...]:
        """Return the indices of the components held."""
        if self.components is None:
            return tuple(range(dimension))
        return tuple("xyz".index(name) for name in self.components)

    def values(self, points: Array, factor: float = 1.0, time: float = 0.0) -> Array:
        """Prescribed displacement (k, held) of points (k, d), m, unless it is ``"exact"``.

        A history's factor multiplies the displacement and the angle of a rotation; `time` (s)
        enters its formulas.
        """
        assert self.displacement != "exact"
        moved = factor * field_values(self.displacement, points, time)
        if self.rotation is not None:
            turn = self.rotation.matrix(factor) - np.eye(points.shape[1])
            moved += (points - np.asarray(self.rotation.centre)) @ turn.T
        return moved

    def velocities(self, points: Array, factor: float, slope: float, time: float) -> Array:
        """Velocity (k, held), m/s: of `values`, with the factor's `slope` (1/s)."""
        assert self.displacement != "exact"
        speed = slope * field_values(self.displacement, points, time)
        speed += factor * field_rates(self.displacement, points, time)
        if self.rotation is not None:
            turning = slope * self.rotation.matrix_rate(factor)
            speed += (points - np.asarray(self.rotation.centre)) @ turning.T
        return speed


# of the duration: times that differ by no more are one, as steps added up are off by less
CLOSE = 1e-9
_LAG = 1e-5  # of the duration: round-off of its differences is 1e-11, their own error 1e-10


@dataclass(frozen=True)
class PrescribedMotion:
    """Prescribed motion of the points that a support holds, by its own values or an exact field.

    Attributes
    ----------
    support : Support
    points : (k, d) array
        In m.
    near : (k, d) array or None
        Points of the material that the points move, which say on which side of a cut they are, m;
        None: the points themselves say it.
    exact : object or None
        The exact solution, where the support says ``"exact"``.
    close : float
        Times that differ by no more from one of the history are that, s.
    """

    support: Support
    points: Array
    near: Array | None
    exact: Any
    close: float = field(default=0.0, kw_only=True)

    @property
    def moves(self) -> bool:
        """Whether the values change in time."""
        timed = self.support.timed if self.exact is None else self.exact.moves
        return bool(timed or self.support.history)

    def values(self, factor: float, time: float = 0.0) -> Array:
        """Prescribed displacement (k, held), m, of a factor of the history at a time in s."""
        if self.exact is None:
            return self.support.values(self.points, factor, time)
        return factor * self._held(self.exact.at(time).displacement(self.points, self.near))

    def at(self, time: float, before: bool = False) -> Array:
        """Prescribed displacement (k, held), m, at a time in s; after a jump there, or before."""
        time = knot_near(self.support.history, time, self.close)
        return self.values(factor_at(self.support.history, time, before), time)

    def velocities(self, time: float, before: bool = False) -> Array:
        """Prescribed velocity (k, held), m/s, at a time in s; after a kink there, or before."""
        history = self.support.history
        time = knot_near(history, time, self.close)
        factor, slope = (of(history, time, before) for of in (factor_at, slope_at))
        if self.exact is None:
            return self.support.velocities(self.points, factor, slope, time)
        field = self.exact.at(time)
        speed = factor * field.velocity(self.points, self.near)
        if slope:
            speed = speed + slope * field.displacement(self.points, self.near)
        return self._held(speed)

    def accelerations(self, time: float, duration: float) -> Array:
        """Prescribed acceleration (k, held), m/s², at a time in s; after a kink there.

        By differences of velocities with later ones, in a motion of that duration in s.
        """
        lag = _LAG * duration
        now, then, last = (self.velocities(time + k * lag) for k in range(3))
        return np.asarray((4.0 * then - 3.0 * now - last) / (2.0 * lag))

    def _held(self, values: Array) -> Array:
        return np.asarray(values[:, list(self.support.held(values.shape[1]))])


class _Load(Strict):
    """A load with numbers or formulas, one per component, or from the exact solution."""

    key: ClassVar[str]  # that gives them

    @property
    def components(self) -> Sequence[float | str] | Literal["exact"]:
        """The numbers and formulas given, or ``"exact"``."""
        given: Sequence[float | str] | Literal["exact"] = getattr(self, self.key)
        return given

    @property
    def exact(self) -> bool:
        """Whether it is taken from the exact solution."""
        return self.components == "exact"

    @property
    def timed(self) -> bool:
        """Whether a formula names the time."""
        return self.components != "exact" and is_timed(self.components)

    def values(self, points: Array, time: float = 0.0) -> Array:
        """Values (n, components) at points (n, d) and a time, s, unless it is ``"exact"``."""
        assert self.components != "exact"
        return field_values(self.components, points, time)


class Gravity(_Load):
    """Acceleration acting on the density.

    Attributes
    ----------
    acceleration
        m/s²
    """

    kind: Literal["gravity"]
    acceleration: Vector

    key: ClassVar[str] = "acceleration"


class BodyForce(_Load):
    """Force per volume, or the exact solution's.

    Attributes
    ----------
    force
        N/m³, a number or a formula in x, y, z, t per component; or 'exact'
    """

    kind: Literal["body_force"]
    force: Components | Literal["exact"]
    history: History | None = None

    key: ClassVar[str] = "force"


class Traction(_Load):
    """Force per area on a part of the boundary (dead load).

    Attributes
    ----------
    traction
        Pa, a number or a formula in x, y, z, t per component; or 'exact'
    """

    kind: Literal["traction"]
    where: str = Field(description=_WHERE)
    traction: Components | Literal["exact"]
    history: History | None = None

    key: ClassVar[str] = "traction"


class CutFaces(_Load):
    """A load on both faces of a cut that is in balance, per area of the undeformed faces.

    It is a dead load: its direction stays what it is when the faces turn.

    Attributes
    ----------
    cut
        name of the cut
    pressure
        Pa, pushes the faces apart; a number or a formula in x, y, z
    traction
        Pa, on the face of the positive side; the other bears the opposite; a number or a formula in
        x, y, z per component
    """

    kind: Literal["cut_faces"]
    cut: str = "cut"
    pressure: Finite | Formula | None = None
    traction: Components | None = None
    history: History | None = None

    rules: ClassVar[Rules] = (
        ("", none_or_both("pressure", "traction"),
         "a load on the faces of a cut has either a pressure or a traction"),
    )  # fmt: skip

    @property
    def components(self) -> Sequence[float | str]:
        """Pressure, or traction on the face of the positive side, Pa."""
        if self.traction is not None:
            return self.traction
        return [] if self.pressure is None else [self.pressure]

    def on_faces(self, points: Array, outward: Array, normals: Array, time: float = 0.0) -> Array:
        """Traction (n, d) in Pa at points (n, d) of faces.

        Parameters
        ----------
        points : (n, d) array
            m.
        outward : (n, d) array
            Unit normals of the faces, out of the material.
        normals : (n, d) array
            Of the cut there, towards its positive side: they tell the faces apart.
        time : float
            s.
        """
        given = self.values(points, time)
        if self.traction is None:
            return np.asarray(-given * outward)
        # the material on the positive side ends where its outward normal points to the other
        positive = np.sum(outward * normals, axis=1) < 0.0
        return np.asarray(np.where(positive, 1.0, -1.0)[:, None] * given)


Load = Annotated[Gravity | BodyForce | Traction | CutFaces, Field(discriminator="kind")]


class Exact(Strict):
    """An exact solution by name; it can prescribe supports and loads, and judge results.

    Attributes
    ----------
    solution
        name; `verify list --exact` shows them
    parameters
        parameters of that solution, SI units
    """

    solution: str
    parameters: dict[str, Finite | list[Finite] | list[list[Finite]]] = Field(default_factory=dict)


def _one_name(given: Any) -> Any:
    """Both names mean the energy μ‖U − I‖² + ½λ tr²(U − I) at any rotation."""
    return "corotational" if given == "finite_rotation" else given


Kinematics = Annotated[
    Literal["linear", "corotational"],
    BeforeValidator(_one_name),
    WithJsonSchema({"enum": ["linear", "corotational", "finite_rotation"], "type": "string"}),
]


class Analysis(Strict):
    """The analysis: statics or dynamics, kinematics, times.

    Attributes
    ----------
    kinematics
        corotational, also called finite_rotation: large rotations
    duration
        dynamic: end time, s
    time_step
        dynamic: largest step, s
    outputs
        dynamic: number of output times, 0 and the end among them (default 11)
    damping
        Rayleigh: mass (1/s) and stiffness (s) factors
    opening
        what a tool_path opens is held by forces that fade as it is swept, or free at once when it
        is passed: of the reference and all own solvers
    """

    kind: Literal["static", "dynamic"] = "static"
    kinematics: Kinematics = "linear"
    duration: Positive | None = None
    time_step: Positive | None = None
    outputs: Count | None = Field(default=None, ge=2)
    damping: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    opening: Literal["late", "swept"] = "swept"

    rules: ClassVar[Rules] = (
        ("", lambda a: a.kind == "dynamic" and a.duration is None,
         "a dynamic analysis needs a duration"),
        ("", lambda a: a.kind == "static" and (a.duration or a.time_step or a.outputs),
         "duration, time_step and outputs belong to a dynamic analysis"),
        ("", lambda a: a.kind == "static" and any(a.damping),
         "damping belongs to a dynamic analysis"),
        ("opening", lambda a: a.kind == "static" and a.opening != "swept",
         "it belongs to a dynamic analysis"),
    )  # fmt: skip

    @property
    def output_times(self) -> tuple[float, ...]:
        """Output times in s, evenly spaced from 0 to the duration; ``(0.0,)`` if static."""
        if self.duration is None:
            return (0.0,)
        count = self.outputs or _OUTPUTS
        return tuple(self.duration * k / (count - 1) for k in range(count))

    def steps(self, largest: float) -> int:
        """Count the equal steps (s) from output to output over a whole motion, at most `largest`.

        Outputs that are closer cut steps short. What opens or jumps between outputs is left out.
        """
        times = self.output_times
        return (len(times) - 1) * max(1, ceil((times[1] - times[0]) / largest * (1 - 1e-9)))
