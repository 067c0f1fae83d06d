"""A picture of a case, and all of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from verify.report.bodies import Body, View
from verify.report.notation import solver_title
from verify.report.turntable import packed


@dataclass
class Picture:
    """One picture: what it shows, and its image once it is drawn."""

    title: str
    description: str
    body: Body
    view: View
    image: bytes = b""  # WebP
    turnable: bool = True  # whether a body in space may be turned in the page

    @cached_property
    def solid(self) -> dict[str, str]:
        """What a view that can be turned needs; empty for plane bodies."""
        return packed(self.body, self.view)

    @property
    def turned(self) -> dict[str, str]:
        """The same if the page has room for it."""
        return self.solid if self.turnable else {}


@dataclass
class CasePictures:
    """The pictures of a case and what has to be said about them.

    `deformed` share view, colours and `scale` (displacements are drawn that much enlarged), as do
    the frames of `film`: for each of some bodies its output times. `tip` are the errors around the
    tip that `tip_at` names.
    """

    deformed: list[Picture] = field(default_factory=list)
    error: list[Picture] = field(default_factory=list)
    film: list[list[Picture]] = field(default_factory=list)
    tip: list[Picture] = field(default_factory=list)
    tip_at: str = ""
    scale: float = 1.0
    notes: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Picture]:
        """Every picture of the case."""
        frames = [picture for body in self.film for picture in body]
        return [*self.deformed, *self.error, *self.tip, *frames]

    def say_left_out(self, what: str, solvers: Sequence[str], shown: int) -> None:
        """Say of which solvers there is no picture, `shown` of them being shown."""
        if solvers:
            names = ", ".join(map(solver_title, solvers))
            self.notes.append(f"Without picture of the {what}, {shown} being shown: {names}.")
