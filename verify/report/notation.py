"""Written forms of numbers, metrics and solvers, and what a page holds: cells, tables, drawings.

Their text is without markup; templates write it as HTML or Markdown and escape it.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from verify.printable import memory_text
from verify.result import Verdict, VerdictRecord


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
    link: str = ""
    span: int = 1


@dataclass
class Table:
    """A table; `kind` is ``prose`` if its cells hold sentences.

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
    """Panels that belong together, with their caption."""

    panels: list[Drawing] = field(default_factory=list)
    caption: str = ""


@dataclass(frozen=True)
class Lead:
    """What a page says first: its question, the answer in sentences, and one figure.

    Numbers and verdicts of the sentences come from the record; `caption` explains the figure.
    """

    question: str
    sentences: Sequence[str]
    panels: Sequence[Drawing | None] = ()
    caption: str = ""


def _cells(row: Sequence[Any]) -> list[Cell]:
    return [cell if isinstance(cell, Cell) else Cell(number(cell)) for cell in row]


_METRICS = {
    "displacement_l2": "relative L² error of the displacement",
    "energy_norm": "relative energy-norm error",
    "jump_l2": "relative L² error of the jump across the cut",
    "contact_pressure": "relative L² error of the contact pressure",
    "contact_oscillation": "oscillation of the contact pressure",
    "contact_overlap": "overlap over p h/E",
    "strain_energy": "strain energy",
    "overlap_depth": "depth of the overlap of faces, m",
    "displacement_max": "largest relative error of the displacement",
    "opening_l2": "relative L² error of the opening profile",
    "opening_max": "largest relative error of the opening profile",
    "displacement_l2_near": "relative L² error of the displacement near tips",
    "displacement_l2_far": "relative L² error of the displacement far from tips",
    "energy_norm_near": "relative energy-norm error near tips",
    "energy_norm_far": "relative energy-norm error far from tips",
    "displacement_l2_max": "relative L² error of the displacement, largest over time",
    "displacement_l2_mean": "relative L² error of the displacement, mean over time",
    "energy_norm_max": "relative energy-norm error, largest over time",
    "energy_norm_mean": "relative energy-norm error, mean over time",
    "jump_l2_max": "relative L² error of the jump, largest over time",
    "jump_l2_mean": "relative L² error of the jump, mean over time",
    "energy_drift": "relative drift of the energy",
    "energy_slope": "secular change of the energy, relative",
    "energy_oscillation": "oscillation of the energy, relative",
    "energy_jump": "relative jump of the energy at a cut",
    "ledger_mismatch": "relative mismatch of the energy balance",
    "linear_momentum_drift": "relative change of the momentum",
    "angular_momentum_drift": "relative change of the angular momentum",
    "released_to_cut": "energy taken at the cut, per area swept",
    "released_mismatch": "share of the energy released at the blade that is not found",
    "part_linear_momentum_drift": "relative drift of the momentum of free parts",
    "part_angular_momentum_drift": "relative drift of the spin of free parts",
}
_ERRORS = set(_METRICS) - {"strain_energy"}
# not drawn and not in tables unless the case judges them; they are in the exported files
NORMS = ("displacement_l2", "energy_norm", "jump_l2")
SECONDARY = _ERRORS - set(NORMS)
_SOLVERS = {"xfem": "XFEM", "conforming": "conforming P1", "reference": "reference", "sofa": "SOFA"}
ROUND_OFF = 1e-11  # relative errors below are round-off, as the rates of a result have it
_MISSING = "–"
# Control characters (not allowed in XML, invisible in HTML), and marks that turn the
# direction of the text around them
_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ufffe\uffff]")
_FLOAT = re.compile(r"(?<![\w.=])(\d+(?:\.\d+)?)e[+-]?\d+\b")
RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def metric_title(name: str) -> str:
    """Return the metric's name in words."""
    return _METRICS.get(name, name.replace("_", " "))


def is_error(name: str) -> bool:
    """Whether the metric is an error by itself, not a quantity that has one."""
    return name in _ERRORS


def error_title(name: str) -> str:
    """Return the title of a judged metric: an error, or the relative error of a quantity."""
    return metric_title(name) if is_error(name) else f"relative error of the {metric_title(name)}"


def solver_title(name: str) -> str:
    """Return the name of a solver, with its parameters, as it is written in figures."""
    return re.sub(r"^\w+", lambda first: _SOLVERS.get(first[0], first[0]), name)


_MOST_DIGITS = 7  # of the ends of an interval


def _decimal(value: float, digits: int) -> tuple[str, int | None]:
    """Split `value` into its written mantissa and, if it needs one, a power of ten."""
    if value == 0:
        return "0", None
    exponent = int(
        f"{value:.{digits - 1}e}".partition("e")[2]
    )  # of the rounded number: 0.9996 is 1.00
    if -3 <= exponent < 5:
        text = f"{value:.{max(digits - 1 - exponent, 0)}f}"
        return text.replace("-", "−"), None
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return mantissa.replace("-", "−"), int(power)


def number(value: Any, digits: int = 4) -> str:
    """Return `value` with `digits` significant digits, as ``1.234×10⁻³`` where that helps."""
    if value is None or isinstance(value, str | bool):
        return _MISSING if value is None else str(value)
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    if not math.isfinite(value):
        return "not finite"
    mantissa, power = _decimal(value, digits)
    if power is None:
        return mantissa
    return f"{'' if mantissa == '1' else f'{mantissa}×'}10{str(power).translate(RAISED)}"


def signed(value: float, form: str = ".2f") -> str:
    """Return `value` with its sign, which nothing has that is written as zero."""
    written = f"{value:+{form}}"
    return written.replace("-", "−") if float(written) else written[1:]


def number_text(value: float | None, digits: int = 3) -> str:
    """Return `value` as plain text for places without markup (alternative texts, tips)."""
    return _MISSING if value is None else f"{value:.{digits}g}"


def digits_beside(value: float, half: float, most: int = 4) -> int:
    """Return how many significant digits of `value` its half-width leaves: to the second of it."""
    if not (half > 0 and math.isfinite(half)) or value == 0 or not math.isfinite(value):
        return most
    apart = math.floor(math.log10(abs(value))) - math.floor(math.log10(half))
    return min(max(apart + 2, 1), most)


def scientific(text: str) -> str:
    """Return `text` with its numbers like ``6.8e-14`` written as `number` writes them."""
    return _FLOAT.sub(_rewritten, text)


def _rewritten(found: re.Match[str]) -> str:
    return number(float(found[0]), len(found[1].replace(".", "")))


def with_interval(value: float | None, low: float | None, high: float | None) -> str:
    """Return an observed value and the interval in which the true one lies."""
    if value is None:
        return _MISSING
    if low is None or high is None or low == high or not all(map(math.isfinite, (low, high))):
        return number(value)
    digits = digits_beside(value, (high - low) / 2.0)
    while digits < _MOST_DIGITS and _decimal(low, digits) == _decimal(high, digits):
        digits += 1
    if digits == _MOST_DIGITS:  # nobody compares more: the width says it
        return f"{number(value)} ± {number((high - low) / 2.0, 1)}"
    return f"{number(value, digits)} [{number(low, digits)}, {number(high, digits)}]"


def error_text(value: float, uncertainty: float) -> str:
    """Return an error ± its uncertainty; one that is not above it, as what it is below."""
    if uncertainty <= 0 or not math.isfinite(value):
        return number(value)
    if abs(value) > uncertainty or not math.isfinite(uncertainty):
        return f"{number(value, digits_beside(value, uncertainty))} ± {number(uncertainty, 2)}"
    most = abs(value) + uncertainty
    step = 10.0 ** (math.floor(math.log10(most)) - 1)
    return f"not resolved (< {number(math.ceil(most / step * (1 - 1e-9)) * step, 2)})"


def observed_text(record: VerdictRecord) -> str:
    """Return an observed value with its interval; an error that may be 0, as what it is below."""
    value, low, high = record.observed, record.low, record.high
    if record.check == "error" and record.verdict is Verdict.PASS and (value or 0.0) < ROUND_OFF:
        return f"round-off ({number(value, 2)})" if value else number(value)
    if record.check in ("error", "ratio") and low == 0.0 and value is not None and high is not None:
        return error_text(value, high - value)
    return with_interval(value, low, high)


def printable(text: Any) -> str:
    """Return `text` without what neither XML nor UTF-8 can hold (shown as U+FFFD)."""
    whole = str(text).encode("utf-8", "replace").decode("utf-8")
    return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", whole)


def seconds_text(value: float | None, beside: float | None = None) -> str:
    """Return a duration in the unit that suits it.

    With `beside`, a duration that is written next to it, the number alone, in the same unit.
    """
    if value is None or not math.isfinite(value):
        return _MISSING
    judged = value if beside is None else beside
    unit, size = next((u for u in (("s", 1.0), ("ms", 1e-3)) if judged >= u[1]), ("µs", 1e-6))
    shown = value / size
    written = f"{shown:.3g}" if shown < 999.5 else f"{shown:.0f}"
    return written if beside is not None else f"{written}\N{NO-BREAK SPACE}{unit}"


def spread_text(middle: float, low: float, high: float) -> str:
    """Return a duration and, in its unit, the least and the largest of its repetitions."""
    return f"{seconds_text(middle)} ({seconds_text(low, middle)}–{seconds_text(high, middle)})"


def bytes_text(value: float | None) -> str:
    """Return an amount of memory."""
    if value is None or not math.isfinite(value):
        return _MISSING
    return memory_text(value)
