"""The one line of a solver's log that says what happened."""

import re
from pathlib import Path

__all__ = ["telling_line"]

_FATAL = re.compile(r"^Fatal Python error: (.+)")  # faulthandler's headline of a crash
_TELLING = re.compile(r"error|exception|abort|killed|fail|cannot|not found", re.IGNORECASE)
_LONGEST = 300


def telling_line(log: Path) -> str:
    """Return the line of `log` that says most about a death: a crash, an error, the last one."""
    try:
        text = log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "left no log"
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines:
        return "said nothing"
    for line in lines:
        if match := _FATAL.match(line):
            return match.group(1)
    tail = lines[-30:]
    line = next((line for line in reversed(tail) if _TELLING.search(line)), lines[-1])
    return line[:_LONGEST]
