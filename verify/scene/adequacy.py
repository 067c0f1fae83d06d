"""Other models of a scene that the reference solves beside its own, to state what a model costs."""

from pydantic import Field

from verify.scene.strict import Strict


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
