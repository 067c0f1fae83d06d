"""Tables of a scene: its initial state and the smaller ones, then all of them together."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from verify.errors import InputError
from verify.printable import place_text
from verify.scene.acceptance import (
    Acceptance,
    BladeCheck,
    KnownFinding,
    Quantity,
    StrainEnergyQuantity,
)
from verify.scene.geometry import Geometry, MeshFile, MeshLevels, ReferenceLevels, Skin
from verify.scene.physics import Analysis, Exact, Load, Material, Support, field_values
from verify.scene.strict import (
    Components,
    Count,
    Finite,
    Line,
    NonNegative,
    Point3,
    Positive,
    Rules,
    Strict,
    Vector,
    none_or_both,
)
from verify.scene.tool_path import Cut

Array = NDArray[np.float64]
# Of a velocity like r^-½, over those within cells: a tip less than 1/1000 of a cell away, and at
# the node but for round-off.
_LARGEST, _UNBOUNDED = 30.0, 1e4


class AtRest(Strict):
    """Undeformed and at rest."""

    kind: Literal["rest"]


class Equilibrium(Strict):
    """Static equilibrium, at rest. Supports and loads have the first factor of their history.

    Attributes
    ----------
    cuts
        whether the cuts that open at the time 0 are open in it; closed: it is the equilibrium of
        the uncut body
    """

    kind: Literal["equilibrium"]
    cuts: Literal["closed", "open"] = "closed"


class Moving(Strict):
    """Undeformed, and moving as a rigid body.

    Attributes
    ----------
    velocity
        translation, m/s; default none
    spin
        angular velocity, rad/s: a number in 2D, a vector in 3D
    centre
        point about which it spins, m; default the origin
    """

    kind: Literal["moving"]
    velocity: Vector | None = None
    spin: Finite | Point3 | None = None
    centre: Vector | None = None

    rules: ClassVar[Rules] = (
        ("", lambda m: m.velocity is None and m.spin is None,
         "a moving body needs a velocity, a spin, or both"),
        ("", lambda m: m.centre is not None and m.spin is None, "centre belongs to a spin"),
    )  # fmt: skip

    def velocities(self, points: Array) -> Array:
        """Velocity (n, d) of points (n, d), m/s."""
        n, d = points.shape
        velocity = np.tile(np.asarray(self.velocity or (0.0,) * d, dtype=float), (n, 1))
        if self.spin is None:
            return velocity
        arm = points - np.asarray(self.centre or (0.0,) * d)
        if d == 2:
            return velocity + self.spin * np.column_stack([-arm[:, 1], arm[:, 0]])
        return velocity + np.cross(np.asarray(self.spin, dtype=float), arm)


class InitialField(Strict):
    """Displacement and velocity by formulas, or of the exact solution at the time 0.

    Attributes
    ----------
    displacement
        m, a number or a formula in x, y, z per component; or 'exact'
    velocity
        m/s, a number or a formula in x, y, z per component; or 'exact'
    """

    kind: Literal["field"]
    displacement: Components | Literal["exact"] | None = None
    velocity: Components | Literal["exact"] | None = None

    rules: ClassVar[Rules] = (
        ("", lambda f: f.displacement is None and f.velocity is None,
         "an initial field needs a displacement, a velocity, or both"),
    )  # fmt: skip

    def state(self, points: Array, near: Array, exact: Any) -> tuple[Array, Array]:
        """Displacement and velocity (n, d) of points (n, d), m and m/s.

        At a node at the tip of a crack the exact velocity is unbounded, like r^-½, and 0 is taken:
        a change of the order of interpolating it from any nodes.

        Parameters
        ----------
        points : (n, d) array
        near : (n, d) array
            Points of the material that they move: on which side of a cut they are.
        exact : ExactSolution or None

        Raises
        ------
        InputError
            If a point lies beside the tip of a crack, where the exact velocity is unbounded.
        """
        at_start = None if exact is None else exact.at(0.0)
        fields = []
        for given, name in ((self.displacement, "displacement"), (self.velocity, "velocity")):
            if given == "exact":
                field = getattr(at_start, name)
                values = field(points, near)
                fields.append(
                    _bounded(values, field(near, near), points) if name == "velocity" else values
                )
            else:
                fields.append(field_values(given or [0.0] * points.shape[1], points))
        return fields[0], fields[1]


def _bounded(values: Array, beside: Array, points: Array) -> Array:
    """Take 0 for velocities (n, d) at a tip; refuse what stands out beside one."""
    size = np.linalg.norm(values, axis=1)
    most = float(np.linalg.norm(beside, axis=1).max(initial=0.0))
    stands_out = ~(size <= _LARGEST * most) & (most > 0.0)
    beside_tip = np.flatnonzero(stands_out & (size <= _UNBOUNDED * most))
    if len(beside_tip):
        raise InputError(
            f"initial.velocity: the exact field is unbounded beside the node "
            f"{place_text(points[beside_tip[0]])}; expected no node so near to the tip at the "
            "time 0: another mesh, or another place of the tip"
        )
    return np.where(stands_out[:, None], 0.0, values)


Initial = Annotated[AtRest | Equilibrium | InitialField | Moving, Field(discriminator="kind")]


def starts_open(initial: Initial) -> bool:
    """Whether the cuts that open at the time 0 or before are open in the initial state.

    A field has a value on each side of them; what else moves or stands still is the uncut body.
    """
    if isinstance(initial, Equilibrium):
        return initial.cuts == "open"
    return isinstance(initial, InitialField)


@dataclass(frozen=True)
class Row:
    """One scene of a family: the case, the name of its parameter, and the value of it here."""

    family: str
    parameter: str
    value: float

    @property
    def label(self) -> str:
        """The row as it stands behind the name of the case."""
        return f"[{self.parameter}={self.value:.12g}]"


class Contact(Strict):
    """Contact of the faces of cuts: unilateral, without friction, of small sliding.

    Attributes
    ----------
    expected
        none: an overlap of faces of cuts is warned of; overlap: the case means it; closed: faces
        press on each other and do not overlap
    """

    expected: Literal["none", "overlap", "closed"] = "none"

    @property
    def closed(self) -> bool:
        """Whether faces of cuts press on each other: part of the physics, unlike the others."""
        return self.expected == "closed"


class Adequacy(Strict):
    """Cheaper or richer models that are measured beside the verdict, which they do not move.

    Attributes
    ----------
    kinematics
        linear kinematics against finite rotation, whichever is asked
    material
        Hooke's law at finite rotation against neo-Hookean material, whichever is asked
    motion
        dynamic: the static answer under the last loads against the motion's end
    """

    kinematics: bool = False
    material: bool = False
    motion: bool = False

    @property
    def models(self) -> list[str]:
        """Names of the models that are compared."""
        return [name for name in ("kinematics", "material", "motion") if getattr(self, name)]


class Pull(Strict):
    """A hook in the material beside a cut, moved or loaded from some time on.

    Attributes
    ----------
    at
        where it grips, in the uncut body, m
    radius
        how far around it grips, m
    cut
        name of the cut at whose edge it pulls
    side
        on which side of the cut it grips
    displacement
        to where it moves, m; or force
    force
        to what it grows, N; or displacement
    begin
        s
    duration
        over which it grows, smoothly, s
    """

    at: Vector
    radius: Positive
    cut: str = "cut"
    side: Literal["positive", "negative"]
    displacement: Vector | None = None
    force: Vector | None = None
    begin: NonNegative
    duration: Positive

    rules: ClassVar[Rules] = (
        ("", none_or_both("displacement", "force"), "a pull has either a displacement or a force"),
        ("", lambda p: len(p.displacement or p.force) != len(p.at)
         and (len(p.displacement or p.force), len(p.at)), "{} components pull at a point of {}"),
    )  # fmt: skip


class Replay(Strict):
    """What `verify play` needs to know beyond the scene; of it only pulls are loads.

    Attributes
    ----------
    visual
        solids: about how many triangles the visual surface has; without it the surface of the
        elements is shown
    collision
        solids: the same for the surface that tools touch
    tool_radius
        of the blade, for contact, m
    tool_force
        with which the blade drags the material that it touches, N
    """

    pulls: list[Pull] = Field(default_factory=list)
    visual: Count | None = None  # fmt: skip
    collision: Count | None = None
    tool_radius: NonNegative = 0.0
    tool_force: NonNegative = 0.0


def _strain_energy_only() -> list[Quantity]:
    return [StrainEnergyQuantity(kind="strain_energy")]


class SceneTables(Strict):
    """Tables of a case as they stand in its file; `Scene` is those that fit one another.

    Attributes
    ----------
    schema_
        version of this schema
    title
        one line
    requirement
        what shall hold, in one sentence
    tags
        e.g. demo, quick, heavy
    """

    schema_: Literal[1] = Field(default=1, alias="schema")
    title: Line
    requirement: Line
    tags: list[Line] = Field(default_factory=list)
    geometry: Geometry
    mesh: MeshLevels
    material: Material
    supports: list[Support] = Field(default_factory=list)
    loads: list[Load] = Field(default_factory=list)
    exact: Exact | None = None
    cuts: list[Cut] = Field(default_factory=list)
    contact: Contact = Field(default_factory=Contact)
    analysis: Analysis = Field(default_factory=Analysis)
    initial: Initial = Field(default_factory=lambda: AtRest(kind="rest"))
    reference: ReferenceLevels = Field(default_factory=ReferenceLevels)
    replay: Replay | None = None
    quantities: Annotated[list[Quantity], Field(min_length=1)] = Field(
        default_factory=_strain_energy_only
    )
    acceptance: list[Acceptance] = Field(default_factory=list)
    known_findings: list[KnownFinding] = Field(default_factory=list)
    adequacy: Adequacy = Field(default_factory=Adequacy)

    # set by `came_from`
    _file: Path | None = PrivateAttr(default=None)
    _name: str = PrivateAttr(default="scene")
    _row: Row | None = PrivateAttr(default=None)

    @property
    def name(self) -> str:
        """Name of the case: its path below the case folder, e.g. ``statics/f1_patch``.

        Of a row of a family with the value: ``slivers/plane[epsilon=0.01]``.
        """
        return self._name

    def came_from(self, file: Path | None, name: str, row: Row | None = None) -> None:
        """Note the case file, name and row of a scene; its mesh file is beside its case file."""
        self._file, self._name, self._row = file, name, row
        if isinstance(self.geometry, MeshFile):
            self.geometry._folder = None if file is None else file.parent

    @property
    def row(self) -> Row | None:
        """Which row of its family it is; None for a case without parameters."""
        return self._row

    @property
    def file(self) -> Path | None:
        """The case file, if it came from one."""
        return self._file

    @property
    def words(self) -> set[str]:
        """Names of the tables that no answer depends on, but for the acceptance."""
        told = {"title", "requirement", "tags", "adequacy"}
        return told if self.contact.closed else {*told, "contact"}

    @property
    def checks(self) -> list[Acceptance | BladeCheck]:
        """Checks that are made of the case: those that it asks for, and one of every blade."""
        bladed = any(cut.on_the_way for cut in self.cuts) and self.analysis.kind != "static"
        return [*self.acceptance, *([BladeCheck()] if bladed else [])]

    @property
    def first_refinement(self) -> int:
        """How often a given mesh is refined for level 0 of the reference.

        Its finest level has nodes as close as the solvers on their finest: elements of second
        degree have some on the middles of their edges.
        """
        asked = self.reference
        return max(0, self.mesh.refine + 2 - asked.degree - (asked.levels - 1))

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        return self.geometry.dimension

    @property
    def cell_dimension(self) -> int:
        """Dimension of the body itself: 2 for a membrane in space, else the space dimension."""
        return 2 if self.geometry.is_membrane else self.dimension

    @property
    def final_cuts(self) -> list[Cut]:
        """Cuts that are there in the end: of a tool path, all that its blade sweeps.

        Raises
        ------
        InputError
            If a blade sweeps a surface that is no cut of another kind; see `ToolPathCut.whole`.
        """
        return [cut.whole() for cut in self.cuts]

    @property
    def played_only(self) -> str | None:
        """Why no solver takes this scene but `verify play`, or None."""
        if isinstance(self.geometry, Skin):
            return "a geometry of kind 'skin' is for `verify play`"
        if self.replay is not None and self.replay.pulls:
            return "pulls at the edges of a cut are for `verify play`"
        if self.replay is not None and any(cut.on_the_way for cut in self.cuts):
            return "a tool_path with a table [replay] is for `verify play`"
        return None

    @property
    def judged_by_exact(self) -> bool:
        """Whether the exact solution is the reference."""
        if self.reference.kind is None:
            return self.exact is not None
        return self.reference.kind == "exact"
