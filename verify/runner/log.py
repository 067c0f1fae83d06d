"""The one line of a solver's log that says what happened."""

import re
import sys
from pathlib import Path

from verify.printable import one_line

__all__ = ["telling_line", "telling_place"]

_FATAL = re.compile(r"^Fatal Python error: (.+)")  # faulthandler's headline of a crash
_TELLING = re.compile(r"error|exception|abort|killed|fail|cannot|not found", re.IGNORECASE)
_PLACE = re.compile(r'^ *File "([^"\n]+)", line (\d+)', re.MULTILINE)
_LONGEST = 300
_READ = 2**18


def telling_line(log: Path) -> str:
    """Return the line of `log` that says most about a death: a crash, an error, the last one."""
    try:
        text = _ends(log)
    except OSError:
        return "left no log"
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines:
        return "said nothing"
    for line in lines:
        if match := _FATAL.match(line):
            return one_line(match.group(1)[:_LONGEST])
    tail = lines[-30:]
    line = next((line for line in reversed(tail) if _TELLING.search(line)), lines[-1])
    return one_line(line[:_LONGEST])


def telling_place(log: Path) -> str:
    """Return the last file and line of a traceback in `log` that somebody's own code is in.

    That is code outside this package and, if there is any, outside Python and what is installed
    with it. Empty if there is no traceback.
    """
    try:
        places = _PLACE.findall(_ends(log))
    except OSError:
        return ""
    own = str(Path(__file__).resolve().parent.parent)
    outside = [place for place in places if not place[0].startswith((own, "<"))]
    installed = (sys.prefix, sys.base_prefix)
    near = [place for place in outside if not place[0].startswith(installed)] or outside
    return one_line(":".join(near[-1])) if near else ""


def _ends(log: Path) -> str:
    """Return the beginning and the end of a log that may be very long."""
    with log.open("rb") as stream:
        head = stream.read(_READ)
        size = stream.seek(0, 2)
        stream.seek(max(_READ, size - _READ))
        return (head + b"\n" + stream.read()).decode("utf-8", errors="replace")
