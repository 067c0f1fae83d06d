"""Tables of a scene, and what follows from them: dimensions, the final cuts, its reference."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, PrivateAttr

from verify.scene.acceptance import Acceptance, KnownFinding, Quantity, StrainEnergyQuantity
from verify.scene.family import Row
from verify.scene.geometry import Geometry, MeshFile, MeshLevels, ReferenceLevels, Skin
from verify.scene.initial import AtRest, Initial
from verify.scene.materials import Material
from verify.scene.physics import Analysis, Exact, Load, Support
from verify.scene.strict import (
    Count,
    Line,
    NonNegative,
    Positive,
    Rules,
    Strict,
    Vector,
    none_or_both,
)
from verify.scene.tool_path import Cut


class Contact(Strict):
    """Contact of faces. No solver here has a contact model: faces that close overlap."""

    expected: Literal["none", "overlap"] = Field(
        default="none",
        description="none: an overlap of faces of cuts is warned of; overlap: the case means it",
    )


class Adequacy(Strict):
    """Cheaper or richer models that are measured beside the verdict, which they do not move."""

    kinematics: bool = Field(
        default=False, description="linear kinematics against finite rotation, whichever is asked"
    )
    motion: bool = Field(
        default=False,
        description="dynamic: the static answer under the last loads against the motion's end",
    )

    @property
    def models(self) -> list[str]:
        """Names of what is measured."""
        return [name for name in ("kinematics", "motion") if getattr(self, name)]


class Pull(Strict):
    """A hook in the material beside a cut, moved or loaded from some time on."""

    at: Vector = Field(description="where it grips, in the uncut body, m")
    radius: Positive = Field(description="how far around it grips, m")
    cut: str = Field(default="cut", description="name of the cut at whose edge it pulls")
    side: Literal["positive", "negative"] = Field(description="on which side of the cut it grips")
    displacement: Vector | None = Field(default=None, description="to where it moves, m; or force")
    force: Vector | None = Field(default=None, description="to what it grows, N; or displacement")
    begin: NonNegative = Field(description="s")
    duration: Positive = Field(description="over which it grows, smoothly, s")

    rules: ClassVar[Rules] = (
        ("", none_or_both("displacement", "force"), "a pull has either a displacement or a force"),
        ("", lambda p: len(p.displacement or p.force) != len(p.at)
         and (len(p.displacement or p.force), len(p.at)), "{} components pull at a point of {}"),
    )  # fmt: skip


class Replay(Strict):
    """What `verify play` needs to know beyond the scene; of it only pulls are loads."""

    pulls: list[Pull] = Field(default_factory=list)
    visual: Count | None = Field(
        default=None, description="solids: about how many triangles the visual surface has; "
        "without it the surface of the elements is shown",
    )  # fmt: skip
    collision: Count | None = Field(
        default=None, description="solids: the same for the surface that tools touch"
    )
    tool_radius: NonNegative = Field(default=0.0, description="of the blade, for contact, m")
    tool_force: NonNegative = Field(
        default=0.0, description="with which the blade drags the material that it touches, N"
    )


def _strain_energy_only() -> list[Quantity]:
    return [StrainEnergyQuantity(kind="strain_energy")]


def _at_rest() -> Initial:
    return AtRest(kind="rest")


class SceneTables(Strict):
    """Tables of a case as they stand in its file; `Scene` is those that fit one another."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of this schema")
    title: Line = Field(description="one line")
    requirement: Line = Field(description="what shall hold, in one sentence")
    tags: list[Line] = Field(default_factory=list, description="e.g. demo, quick, heavy")
    geometry: Geometry
    mesh: MeshLevels
    material: Material
    supports: list[Support] = Field(default_factory=list)
    loads: list[Load] = Field(default_factory=list)
    exact: Exact | None = None
    cuts: list[Cut] = Field(default_factory=list)
    contact: Contact = Field(default_factory=Contact)
    analysis: Analysis = Field(default_factory=Analysis)
    initial: Initial = Field(default_factory=_at_rest)
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
            If a blade sweeps what is no cut of another kind; see `ToolPathCut.whole`.
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
