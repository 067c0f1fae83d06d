"""Stability maps: one row per method, one column per sliver size, a sign and a number in each cell.

The sign carries the verdict and the number the value; the tint repeats the sign and says nothing
of its own.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.markup import Markup, joined, tag

__all__ = ["MAP_STYLE", "SIGNS", "Cell", "graded", "listed", "size_text", "stability_map"]

# sign, words, background: light to dark, so that it prints in grey
SIGNS = {
    "good": ("●", "#eaf3ee"),
    "fair": ("◐", "#f4ecd2"),
    "poor": ("○", "#f0c9a8"),
    "bad": ("✕", "#b5532a"),
    "none": ("–", "#ffffff"),
}
MAP_STYLE = """
table.map { width: auto; } table.map td, table.map th { padding: 3px 8px; text-align: center; }
table.map th[scope=row] { text-align: left; font-weight: 400; white-space: nowrap; }
table.map td { border: 1px solid #fff; min-width: 4.2em; }
table.map tbody tr:last-child > * { border-bottom: 1.5px solid var(--ink); }
table.map td.bad { color: #fff; }
.panels figure { margin: 8px 0; } .time { max-width: 440px; width: 100%; height: auto; }
"""

Cell = tuple[str, str, str]  # grade, what is written beside its sign, tip


def size_text(size: float) -> str:
    """Write a sliver size as a column head."""
    return "0" if size == 0.0 else f"{size:g}"


def stability_map(
    title: str,
    legend: Mapping[str, str],
    sizes: Sequence[float],
    rows: Sequence[tuple[str, Sequence[Cell | None]]],
) -> Markup:
    """Return a map as a table.

    Parameters
    ----------
    title : str
    legend : mapping
        What each grade means here; "none" may be left out.
    sizes : sequence of float
        Columns.
    rows : sequence of (name, cells)
        One cell per column; None where nothing was measured.
    """
    colours = Markup(
        "".join(f"table.map td.{grade} {{ background: {c}; }}" for grade, (_, c) in SIGNS.items())
    )
    head = [tag("th", "ε ="), *(tag("th", size_text(s), scope="col") for s in sizes)]
    body = [
        tag("tr", tag("th", name, scope="row"), [_cell(cell) for cell in cells])
        for name, cells in rows
    ]
    said = "; ".join(f"{SIGNS[grade][0]} {words}" for grade, words in legend.items())
    table = tag(
        "table", tag("caption", title), tag("thead", tag("tr", head)), tag("tbody", body),
        class_="map",
    )  # fmt: skip
    return joined(
        tag("style", colours),
        tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=title),
        tag("p", said + ".", class_="quiet"),
    )


def _cell(cell: Cell | None) -> Markup:
    if cell is None:
        return tag("td", SIGNS["none"][0], class_="none")
    grade, written, tip = cell
    sign = SIGNS[grade][0]
    return tag("td", f"{sign} {written}".strip(), class_=grade, title=tip or None)


def graded(value: float | None, steps: Sequence[tuple[float, str]], reason: str = "") -> Cell:
    """Grade a value: the first of (least value, grade) that it reaches, or "bad".

    It is written with so many digits that it is not rounded up to what it misses.
    """
    if value is None:
        return ("none", "", reason)
    grade = next((name for least, name in steps if value >= least), "bad")
    better = [least for least, _ in steps if least > value]
    form = "e" if grade == "bad" else "g"
    for digits in range(2 if form == "g" else 0, 9):
        written = f"{value:.{digits}{form}}"
        if all(float(written) < least for least in better):
            break
    return (grade, written, reason)


def listed(records: Sequence[Mapping[str, Any]], **fixed: Any) -> list[Mapping[str, Any]]:
    """Return the records in which all of these keys have these values."""
    return [r for r in records if all(r.get(key) == value for key, value in fixed.items())]
