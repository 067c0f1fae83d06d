"""Text of others made safe to show: on a terminal, in a message, in a table for a spreadsheet."""

import csv
import io
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_LONGEST = 2000  # characters of a message; more is no message
# ESC and the like; marks of direction, which reorder what stands beside them; lone surrogates
_HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")
_KEPT = "\n\t"
# an error with its text, behind marks of a log such as "[ERROR] [Module] "
_NAMED = re.compile(
    r"(?:\[\w+\]\s*)*((?:[A-Za-z_]\w*\.)*[A-Z]\w*(?:Error|Exception|Exit|Interrupt)(?::.*)?)$"
)
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")


def visible(text: str) -> str:
    r"""Write what does not print, or moves what does, as ``\x1b``; lines and tabs stay."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        mark
        if mark in _KEPT or unicodedata.category(mark) not in _HIDDEN
        else mark.encode("unicode_escape").decode("ascii")
        for mark in text
    )


def one_line(text: object, longest: int = _LONGEST) -> str:
    """Return `text` on one line that a terminal can be given, with its middle left out if long."""
    whole = str(text)
    if len(whole) > 4 * longest:  # before the work of splitting it
        whole = f"{whole[: 2 * longest]} {whole[-2 * longest :]}"
    line = visible(" ".join(whole.split()))
    if len(line) <= longest:
        return line
    half = (longest - 3) // 2
    return f"{line[:half]} … {line[-half:]}"


def shown(value: object, longest: int = 60) -> str:
    """Return the ``repr`` of a value that a message quotes, cut to `longest` characters."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of more digits than Python prints
        return f"a value of type '{type(value).__name__}' that cannot be written out"
    return text if len(text) <= longest else f"{text[: longest - 3]}…"


def words_of(error: BaseException, longest: int = _LONGEST) -> str:
    """Return kind and first line of an error; to say it may fail in its turn."""
    try:
        said = str(error).strip().partition("\n")[0]
    except Exception:
        said = ""
    return one_line(f"{type(error).__name__}{': ' if said else ''}{said}", longest)


def last_error(said: str) -> str:
    """Return the last line in which Python names an error, else the last line; "" of nothing.

    What a program says at its end, after its error or before, is not why it ended.
    """
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    named = [found[1] for line in lines if (found := _NAMED.match(line))]
    return one_line((named or lines or [""])[-1])


def duration_text(seconds: float) -> str:
    """Return a rough duration: seconds, minutes or hours, with one or two digits."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{max(seconds, 1.0):.2g} s" if seconds < 9.5 else f"{round(seconds, -1):.0f} s"


def memory_text(amount: float) -> str:
    """Return bytes in the units of ``--memory``: MB, or GB from 1 on (powers of ten)."""
    return f"{amount / 1e6:.0f} MB" if amount < 0.9995e9 else f"{amount / 1e9:.3g} GB"


def place_text(point: Iterable[float]) -> str:
    """Return the coordinates of a point, with six digits each, in parentheses."""
    return f"({', '.join(f'{x:.6g}' for x in point)})"


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Return a table with a head, one line per row.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of mapping
        Values by column; a missing one is an empty cell. A text that a spreadsheet would
        compute (``=HYPERLINK(…)``) gets an apostrophe in front; numbers are as they are.
    """
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return buffer.getvalue()


def _cell(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    text = visible(value)
    return f"'{text}" if text.lstrip(" ").startswith(_FORMULA) else text
