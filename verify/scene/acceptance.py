"""Quantities and acceptance checks of a scene."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from verify.scene.strict import (
    Finite,
    Line,
    NonNegative,
    Point3,
    Positive,
    Rules,
    Strict,
    Vector,
    none_or_both,
    one_alone,
)

# of a cut; near and far: closer to a tip or front than a tenth of its cut, and the rest
OVERLAP = "overlap_depth"  # m, largest over time: of itself the error of faces that must not meet
OF_CUTS = ("jump_l2", "opening_l2", "opening_max", "jump_l2_max", "jump_l2_mean", OVERLAP)
# of a scene with contact; contact_overlap: its depth over p h/E
OF_CONTACT = (
    "contact_pressure", "contact_oscillation", "contact_extent", "contact_force", "contact_overlap",
)  # fmt: skip
# max and mean: over time; the last nine need no reference
OF_MOTION = (
    "displacement_l2_max", "displacement_l2_mean", "energy_norm_max", "energy_norm_mean",
    "jump_l2_max", "jump_l2_mean",
    "energy_drift", "energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch",
    "linear_momentum_drift", "angular_momentum_drift",
    "part_linear_momentum_drift", "part_angular_momentum_drift", "released_mismatch",
)  # fmt: skip
# measured whether a quantity asks for them or not
METRICS = tuple(dict.fromkeys((
    "displacement_l2", "energy_norm", "jump_l2", "displacement_max", "opening_l2", "opening_max",
    "displacement_l2_near", "displacement_l2_far", "energy_norm_near", "energy_norm_far",
    OVERLAP, *OF_CONTACT, *OF_MOTION,
)))  # fmt: skip
OF_MOVING_PARTS = ("linear_momentum", "angular_momentum", "kinetic_energy")
_DIRECTED = ("inertia", "linear_momentum", "angular_momentum")  # of a part, along an axis
Time = Annotated[
    NonNegative | None, Field(description="dynamic: when, s; default the last output time")
]


class StrainEnergyQuantity(Strict):
    """Strain energy of the whole body, J (2D: J per metre of thickness)."""

    kind: Literal["strain_energy"]

    name: ClassVar[str] = "strain_energy"  # under which it is reported


class DisplacementQuantity(Strict):
    """A displacement component at a point of the body, m.

    Attributes
    ----------
    point
        material coordinates, m; not on a cut
    """

    kind: Literal["displacement"]
    name: Line
    point: Vector
    component: Literal["x", "y", "z"]
    time: Time = None


class MaximumDisplacementQuantity(Strict):
    """The largest length of the displacement over the body, m."""

    kind: Literal["maximum_displacement"]
    name: Line = "maximum_displacement"
    time: Time = None


class OpeningQuantity(Strict):
    """The displacement jump (positive minus negative side) at a point of a cut, m.

    Attributes
    ----------
    at
        2D: position as a fraction of the cut's length
    point
        3D: a point of the cut, m
    """

    kind: Literal["opening"]
    name: Line
    cut: str = "cut"
    at: float | None = Field(default=None, strict=True, ge=0.0, le=1.0)
    point: Point3 | None = None
    component: Literal["normal", "tangential"] = "normal"
    time: Time = None


class PartQuantity(Strict):
    """A number of a separated part: of the connected piece of material that holds a point.

    Attributes
    ----------
    point
        material coordinates of a point of it, m; not on a cut; default: of all
    of
        inertia and angular_momentum about its own centre; mass and inertia of it undeformed
    component
        of inertia and momenta; in 2D inertia and spin are about z
    """

    kind: Literal["part"]
    name: Line
    point: Vector | None = None
    of: Literal[
        "mass", "inertia", "linear_momentum", "angular_momentum", "kinetic_energy",
        "strain_energy",
    ]  # fmt: skip
    component: Literal["x", "y", "z"] | None = None
    time: Time = None

    rules: ClassVar[Rules] = (
        ("component", lambda p: p.of in _DIRECTED and p.component is None and p.of,
         "the {} of a part needs one"),
        ("component", lambda p: p.of not in _DIRECTED and p.component is not None and p.of,
         "the {} of a part has none"),
        ("time", lambda p: p.of in ("mass", "inertia") and p.time is not None and p.of,
         "the {} of a part is that of it undeformed"),
    )  # fmt: skip


class _ResultantQuantity(Strict):
    """A component of a force or of a moment.

    Attributes
    ----------
    component
        in 2D a moment is about z
    """

    name: Line
    of: Literal["force", "moment"] = "force"
    component: Literal["x", "y", "z"]
    time: Time = None

    @property
    def about(self) -> list[float] | None:
        """Point that a moment is about, m."""
        return getattr(self, "point", getattr(self, "centre", None))

    def direction(self, dimension: int) -> NDArray[np.float64]:
        """Return the unit vector (d,) of a force, or the axis of a moment."""
        return np.eye(3)["xyz".index(self.component)][: 3 if self.of == "moment" else dimension]


class ReactionQuantity(_ResultantQuantity):
    """Force or moment of a support on the body, N or N m (2D: per metre of thickness).

    Attributes
    ----------
    where
        the part that a support of the case holds, as it says it
    centre
        that a moment is about, m
    """

    kind: Literal["reaction"]
    where: Line
    centre: Vector | None = None

    rules: ClassVar[Rules] = (
        ("centre", lambda p: (p.of == "moment") != (p.centre is not None),
         "it belongs to a moment, which needs one"),
    )  # fmt: skip


class SectionQuantity(_ResultantQuantity):
    """Force or moment in a section: of what lies beyond it on the rest (2D: per metre).

    Attributes
    ----------
    point
        of the plane, m; a moment is about it
    normal
        points beyond it; tension along it is positive
    """

    kind: Literal["section"]
    point: Vector
    normal: Vector

    rules: ClassVar[Rules] = (
        ("normal", lambda p: not any(p.normal), "is zero"),
        ("normal", lambda p: len(p.normal) != len(p.point) and (len(p.normal), len(p.point)),
         "{} components at a point of {}"),
    )  # fmt: skip


class StressQuantity(Strict):
    """Mean of a stress component over a small ball of the body, Pa.

    Attributes
    ----------
    point
        centre of the ball, m
    radius
        m; the ball lies in the body and on one side of all cuts
    """

    kind: Literal["stress"]
    name: Line
    point: Vector
    radius: Positive
    component: Literal["xx", "yy", "zz", "xy", "xz", "yz"]
    time: Time = None


class FractureQuantity(Strict):
    """A quantity at an end of a plane cut, or at a point of a front.

    Attributes
    ----------
    end
        2D, and at a blade: which end of the cut
    point
        3D: a point of the front of a disc or polygon, m
    time
        dynamic: an output time, s; default the last
    """

    name: Line
    cut: str = "cut"
    end: Literal["start", "end"] | None = None
    point: Point3 | None = None
    time: NonNegative | None = None

    @property
    def column(self) -> int:
        """Place among K_I, K_II, K_III, G."""
        return len(getattr(self, "mode", "")) - 1

    @property
    def at_blade(self) -> bool:
        """Whether it is measured at a blade, not at a point of a front."""
        return self.column == 2 and self.point is None


class EnergyReleaseQuantity(FractureQuantity):
    """The energy release rate G, J/m²: of its own domain integral, not of factors."""

    kind: Literal["energy_release_rate"]


class StressIntensityQuantity(FractureQuantity):
    """A factor at an end of a plane cut, a point of a front, or of mode III at a blade, Pa √m.

    Attributes
    ----------
    mode
        III in 3D only
    radius
        mode III: how far behind the blade of a tool path in space the cut is read, m
    """

    kind: Literal["stress_intensity"]
    mode: Literal["I", "II", "III"] = "I"
    radius: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", lambda p: p.at_blade != (p.radius is not None),
         "a radius belongs to mode III at a blade, which needs one"),
        ("", lambda p: p.at_blade and p.end != "end",
         "mode III is asked for at the blade: end = 'end'"),
    )  # fmt: skip


Quantity = Annotated[
    StrainEnergyQuantity | DisplacementQuantity | MaximumDisplacementQuantity | OpeningQuantity
    | PartQuantity | ReactionQuantity | SectionQuantity | StressQuantity
    | EnergyReleaseQuantity | StressIntensityQuantity,
    Field(discriminator="kind"),
]  # fmt: skip


class _Check(Strict):
    """What every check says: whose metric it is.

    Attributes
    ----------
    solver
        the one solver that is judged; default: each that is asked and does not refuse the case
    metric
        displacement_l2, energy_norm, jump_l2 (relative errors), strain_energy, overlap_depth (m),
        or the name of a quantity
    """

    solver: str | None = None
    metric: str

    @field_validator("solver", "to", mode="after", check_fields=False)
    @classmethod
    def _one_name(cls, name: str | None) -> str | None:
        return " ".join(name.split()) if name else name

    @property
    def compared(self) -> str | None:
        """The other solver that the check needs, if it needs one."""
        return None


class RateCheck(_Check):
    """The observed order of an error over the mesh levels.

    Attributes
    ----------
    within
        tolerance of `equals`
    """

    check: Literal["rate"]
    at_least: Finite | None = None
    equals: Finite | None = None
    within: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", none_or_both("at_least", "equals"),
         "a rate check has either at_least, or equals with within"),
        ("", one_alone("equals", "within"), "equals and within go together"),
    )  # fmt: skip


class BoundCheck(_Check):
    """The relative error on the finest mesh; of overlap_depth the depth itself, m."""

    check: Literal["error"]
    at_most: Positive


class RatioCheck(_Check):
    """The error over another solver's at equal mesh size, on every level.

    Without a `solver` it is asked of all but the one compared with. In a case with a parameter it
    may be the error over the same solver's in another `row`.

    Attributes
    ----------
    to
        the solver compared with
    row
        value of the case's parameter in the row compared with, instead of a solver
    within
        |ratio − 1| must not exceed it
    """

    check: Literal["ratio"]
    to: str = "conforming"
    row: Finite | None = None
    at_most: Positive | None = None
    within: Positive | None = None

    rules: ClassVar[Rules] = (
        ("", none_or_both("at_most", "within"), "a ratio check has either at_most or within"),
        ("", lambda p: p.row is not None and p.to != "conforming",
         "a ratio check is either to a solver or to a row"),
    )  # fmt: skip

    @property
    def compared(self) -> str | None:
        """The other solver, unless the error is over the error in another row."""
        return self.to if self.row is None else None


class ValueCheck(_Check):
    """A quantity against a stated value (exact, or independent of this project).

    Attributes
    ----------
    source
        where the value comes from
    """

    check: Literal["value"]
    equals: Finite
    relative_tolerance: Positive
    source: Line


class BladeCheck(_Check):
    """What forces at a released cut take, against what a blade on its way releases.

    No case asks for it: it is made of every solver, wherever a blade is on its way.
    """

    check: Literal["excess"] = "excess"
    metric: str = "released_to_cut"


Acceptance = Annotated[
    RateCheck | BoundCheck | RatioCheck | ValueCheck, Field(discriminator="check")
]


class KnownFinding(Strict):
    """A check that a solver is known to fail: shown as failed, not counted in the exit code.

    Attributes
    ----------
    reason
        why it fails, in one sentence
    """

    solver: str
    check: Literal["rate", "error", "ratio", "value", "excess"]
    metric: str
    reason: Line

    def concerns(
        self, check: RateCheck | BoundCheck | RatioCheck | ValueCheck | BladeCheck
    ) -> bool:
        """Whether `check` is the one that fails and is made of the solver."""
        same = (check.check, check.metric) == (self.check, self.metric)
        return same and check.solver in (None, self.solver) and check.compared != self.solver
