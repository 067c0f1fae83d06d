"""Work that can be done a piece at a time: a generator that yields in between.

What it is about stays as it was, for all who look at it, until the last piece is done. So a program
that has little time in each of its steps can do one piece in each.
"""

from collections.abc import Generator

__all__ = ["MANY", "InPieces", "in_one_go"]

MANY = 24  # elements: what a cut through more asks for comes in more pieces

type InPieces[Made] = Generator[None, None, Made]


def in_one_go[Made](work: InPieces[Made]) -> Made:
    """Do all pieces; what has been made."""
    while True:
        try:
            next(work)
        except StopIteration as done:
            made: Made = done.value
            return made
