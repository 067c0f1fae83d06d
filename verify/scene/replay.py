"""Table of a simulated scene: what pulls the incision open, the tool, surfaces beside the mesh.

Nothing here changes what a solver of the scene is asked for, but the pulls: they are loads.
"""

from typing import Literal

from pydantic import Field, model_validator

from verify.scene.strict import Count, NonNegative, Positive, Strict, Vector


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
