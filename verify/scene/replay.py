"""How a cutting scene is played: what pulls the incision open, the tool, surfaces beside the mesh.

Nothing here changes what a solver of the scene is asked for, but the pulls: they are loads.
"""

from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from verify.scene.nearest import nearest
from verify.scene.strict import Count, NonNegative, Positive, Strict, Vector
from verify.scene.tool_path import ToolPathCut

if TYPE_CHECKING:
    from verify.scene.scene import Scene

__all__ = ["Pull", "Replay", "check_replay"]


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

    @model_validator(mode="after")
    def _moves_or_loads(self) -> "Pull":
        if (self.displacement is None) == (self.force is None):
            raise ValueError("a pull has either a displacement or a force")
        vector = self.displacement if self.displacement is not None else self.force
        assert vector is not None
        if len(vector) != len(self.at):
            raise ValueError(f"{len(vector)} components pull at a point of {len(self.at)}")
        return self


class Replay(Strict):
    """What `verify play` needs to know beyond the scene itself."""

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


def check_replay(scene: "Scene") -> None:
    """Raise ValueError if tool paths, pulls or surfaces do not fit the rest of the scene."""
    analysis, d = scene.analysis, scene.dimension
    for i, cut in enumerate(scene.cuts):
        if not isinstance(cut, ToolPathCut):
            continue
        if analysis.duration is None:
            raise ValueError(f"cuts[{i}]: a tool_path takes time; it needs a dynamic analysis")
        if cut.ends_at > analysis.duration * (1.0 + 1e-12):
            raise ValueError(
                f"cuts[{i}]: the tool arrives at {cut.ends_at:g} s, after the end of the analysis "
                f"at {analysis.duration:g} s"
            )
    if scene.replay is None:
        return
    if analysis.duration is None or analysis.time_step is None:
        raise ValueError("replay: needs a dynamic analysis with a time_step")
    names = [cut.name for cut in scene.cuts]
    for i, pull in enumerate(scene.replay.pulls):
        place = f"replay.pulls[{i}]"
        if len(pull.at) != d:
            raise ValueError(f"{place}.at: {len(pull.at)} coordinates in a {d}D scene")
        if pull.cut not in names:
            raise ValueError(f"{place}.cut: no cut '{pull.cut}'{nearest(pull.cut, names)}")
        if pull.begin >= analysis.duration:
            raise ValueError(f"{place}.begin: {pull.begin:g} s is after the end of the analysis")
    solid = scene.cell_dimension == 3
    for key in ("visual", "collision"):
        if getattr(scene.replay, key) is not None and not solid:
            raise ValueError(f"replay.{key}: a plane body or membrane is its own surface")
