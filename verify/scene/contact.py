"""Expected contact of the faces of cuts that the deformation presses together."""

from typing import Literal

from pydantic import Field

from verify.scene.strict import Strict


class Contact(Strict):
    """Contact of faces. No solver here has a contact model: faces that close overlap."""

    expected: Literal["none", "overlap"] = Field(
        default="none",
        description="none: an overlap of faces of cuts is warned of; overlap: the case means it",
    )
