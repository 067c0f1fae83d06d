"""View data: cells, tables, drawings.

Their text is without markup; templates write it as HTML or Markdown and escape it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from verify.report.notation import number


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Parameters
    ----------
    text : str
    note : str
        A second, quiet line.
    verdict : str
        A word that stands in a frame before the text: PASS, FAIL, UNDECIDED, ERROR.
    strong : bool
    tip : str
    grade : str
        Of a stability map: good, fair, poor, bad or none.
    link : str
        Identifier on the page that the text leads to.
    span : int
        Columns.
    """

    text: str = ""
    note: str = ""
    verdict: str = ""
    strong: bool = False
    tip: str = ""
    grade: str = ""
    link: str = ""
    span: int = 1


@dataclass
class Table:
    """A table; `kind` is ``prose`` if its cells hold sentences, ``map`` if they are tinted.

    The first cell of a row is its head if `named`. Cells may be given as text, or as a number that
    `number` writes; they are kept as `Cell`.
    """

    caption: str
    head: Sequence[Any]
    rows: Sequence[Sequence[Any]]
    kind: str = ""
    named: bool = False

    def __post_init__(self) -> None:
        self.head, self.rows = _cells(self.head), [_cells(row) for row in self.rows]


@dataclass(frozen=True)
class Drawing:
    """A figure as the inside of an SVG element of `size` = (width, height) in points.

    `alt` says in words what it shows.
    """

    body: str
    size: tuple[float, float]
    alt: str
    kind: str = "panel"


@dataclass
class Figure:
    """Panels that belong together, and what has to be said about them."""

    panels: list[Drawing] = field(default_factory=list)
    caption: str = ""


def _cells(row: Sequence[Any]) -> list[Cell]:
    return [cell if isinstance(cell, Cell) else Cell(number(cell)) for cell in row]
