"""The work of a cut in pieces of about equal length, so that a step can do one of them.

What is cut, the body that moves, and the surfaces follow one after the other; until the last piece
is done the mechanics go on with the body as it was. Pieces are bounded by what they do and by how
many elements a cut may split, never by a clock: a replay is the same on any machine.
"""

from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.resumable import MANY, Resumable
from verify.simulator.body_parts import BodyParts, held_nodes
from verify.simulator.cutting.growing_body import Increment
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.grips import Grips
from verify.simulator.surfaces import Surfaces
from verify.xfem.body import DynamicBody
from verify.xfem.phantom import PhantomMesh

__all__ = ["MOST", "Followed", "Pieces", "StagedCut"]

MOST = 36  # elements that a cut whose work is spread may split, but for ties

Pieces = Generator[Increment | None, None, "Followed | None"]


class Followed(NamedTuple):
    """What moves from now on, and how it comes from what has moved until now."""

    increment: Increment
    body: DynamicBody
    grips: Grips
    solver: Cholesky


@dataclass(frozen=True)
class StagedCut:
    """How cuts are made.

    Attributes
    ----------
    cutter : SemiProgressiveCutter
    surfaces : Surfaces
    parts_after : callable
        What the body is made of after an increment, given all its pieces.
    body_of : callable
        The body of these parts.
    end_of_step : callable
        Time at the end of the step under way, s.
    timed : callable
        Measures what a phase takes.
    """

    cutter: SemiProgressiveCutter
    surfaces: Surfaces
    parts_after: Callable[[Increment, PhantomMesh], BodyParts]
    body_of: Callable[[BodyParts], DynamicBody]
    end_of_step: Callable[[], float]
    timed: Callable[[str], AbstractContextManager[None]]

    def pieces(self, until: float, most: int | None, solver: Cholesky) -> Pieces:
        """Lead the blades to a time, and do piece by piece what that asks for.

        Parameters
        ----------
        until : float
            s.
        most : int or None
            How many elements may be split, see `SemiProgressiveCutter.looking`.
        solver : Cholesky
            Of the body as it is. Until the last piece is done it may be used, but only to
            factorise and solve in one go: its memory is shared with that of the body to come.

        Yields
        ------
        Increment or None
            What has been cut of which the mechanics do not know.

        Returns
        -------
        Followed or None
            None if nothing was cut.
        """
        looking = self.cutter.looking(until, most)
        division = yield from self._each("cutting", looking, None)
        if division is None:
            return None
        with self.timed("cutting"):
            increment = self.cutter.divide(division, self.end_of_step())
        yield increment
        with self.timed("assembly"):
            parts = self.parts_after(increment, self.cutter.phantom_mesh())
            body = self.body_of(parts)
        yield increment
        with self.timed("assembly"):
            other = solver.extended(body.pattern, increment.source, held_nodes(body))
        worn = other.is_worn
        if worn:
            renewing = other.renewing(body.pattern, held_nodes(body))
            other = yield from self._each("assembly", renewing, increment)
        if worn or len(increment.cells) > MANY:
            yield increment
        with self.timed("assembly"):
            body.force.prepare(body.pattern)
        yield increment
        yield from self._each("cutting", self.surfaces.following(increment), increment)
        return Followed(increment, body, parts.grips, other)

    def _each[Made](
        self, phase: str, work: Resumable[Made], known: Increment | None
    ) -> Generator[Increment | None, None, Made]:
        """Do some work in its own pieces, each of them timed."""
        while True:
            with self.timed(phase):
                try:
                    next(work)
                except StopIteration as done:
                    made: Made = done.value
                    return made
            yield known
