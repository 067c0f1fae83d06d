"""The one line of a solver's log that says what happened."""

import re
from pathlib import Path

from verify.printable import one_line

_FATAL = re.compile(r"^Fatal Python error: (.+)")  # faulthandler's headline of a crash
_TELLING = re.compile(r"error|exception|abort|killed|fail|cannot|not found", re.IGNORECASE)
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


def _ends(log: Path) -> str:
    """Return the beginning and the end of a log that may be very long."""
    with log.open("rb") as stream:
        head = stream.read(_READ)
        size = stream.seek(0, 2)
        stream.seek(max(_READ, size - _READ))
        return (head + b"\n" + stream.read()).decode("utf-8", errors="replace")
