"""Tables of a scene, and what follows from them: dimensions, the final cuts, its reference."""

from typing import Annotated, Literal

from pydantic import Field

from verify.scene.acceptance import Acceptance, KnownFinding, Quantity, StrainEnergyQuantity
from verify.scene.adequacy import Adequacy
from verify.scene.contact import Contact
from verify.scene.cuts import Cut, whole_cut
from verify.scene.geometry import Geometry, MeshFile
from verify.scene.initial import AtRest, Initial
from verify.scene.materials import Material
from verify.scene.mesh import MeshLevels, ReferenceLevels
from verify.scene.physics import Analysis, Exact, Load, Support
from verify.scene.replay import Replay
from verify.scene.skin import Skin
from verify.scene.strict import Line, Strict
from verify.scene.tool_path import ToolPathCut


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

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        return self.geometry.dimension

    @property
    def cell_dimension(self) -> int:
        """Dimension of the body itself: 2 for a membrane in space, else the space dimension."""
        membrane = isinstance(self.geometry, MeshFile) and self.geometry.cells == "surface"
        membrane |= isinstance(self.geometry, Skin) and self.geometry.is_membrane
        return 2 if membrane else self.dimension

    @property
    def final_cuts(self) -> list[Cut]:
        """Cuts that are there in the end: of a tool path, all that its blade sweeps.

        Raises
        ------
        InputError
            If a blade sweeps what is no cut of another kind; see `ToolPathCut.whole`.
        """
        return [whole_cut(cut) for cut in self.cuts]

    @property
    def played_only(self) -> str | None:
        """Why no solver takes this scene but `verify play`, or None."""
        if isinstance(self.geometry, Skin):
            return "a geometry of kind 'skin' is for `verify play`"
        if self.replay is not None and self.replay.pulls:
            return "pulls at the edges of a cut are for `verify play`"
        if self.replay is not None and any(isinstance(cut, ToolPathCut) for cut in self.cuts):
            return "a tool_path with a table [replay] is for `verify play`"
        return None

    @property
    def judged_by_exact(self) -> bool:
        """Whether the exact solution is the reference."""
        if self.reference.kind is None:
            return self.exact is not None
        return self.reference.kind == "exact"
