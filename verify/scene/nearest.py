"""The nearest valid word, for error messages."""

from collections.abc import Iterable
from difflib import get_close_matches

_FEW, _SHOWN = 30, 3


def nearest(word: str, words: Iterable[str]) -> str:
    """Give a phrase to put behind "no such …": the nearest of `words`, or all if they are few."""
    known = sorted(words)
    close = get_close_matches(word, known, n=1, cutoff=0.6)
    if close:
        return f"; did you mean '{close[0]}'?"
    if len(known) > _FEW:
        return f"; expected one of {len(known)}, such as {', '.join(known[:_SHOWN])}"
    return f"; expected one of {', '.join(known)}" if known else ""
