"""Resumable work: a generator that yields between its pieces.

What it is about stays as it was, for all who look at it, until the last piece is done. So a program
that has little time in each of its steps can do one piece in each.
"""

from collections.abc import Generator

__all__ = ["MANY", "Resumable", "finished"]

MANY = 24  # elements: what a cut through more asks for comes in more pieces

type Resumable[Made] = Generator[None, None, Made]


def finished[Made](work: Resumable[Made]) -> Made:
    """Do all that is left; return what has been made."""
    while True:
        try:
            next(work)
        except StopIteration as done:
            made: Made = done.value
            return made
