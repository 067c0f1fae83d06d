"""Waits said in lines of their own, wherever a stream leads: to a file, a pipe or a terminal."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TextIO

_FIRST, _LONGEST = 2.0, 60.0  # s of silence before the first line, and before any other


class Waiting:
    """A thread that says what is waited for after 2 s without a word, then ever more seldom.

    Parameters
    ----------
    stream : TextIO
    doing : callable
        Returns what is being done; empty: nothing is said.
    """

    def __init__(self, stream: TextIO, doing: Callable[[], str]) -> None:
        self._stream, self._doing = stream, doing
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._said, self._patience = monotonic(), _FIRST
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        """Write a line; what is waited for now has begun."""
        with self._lock:
            self._write(text)
            self._patience = _FIRST

    def close(self) -> None:
        """Say no more."""
        self._ended.set()
        self._thread.join()

    def _write(self, text: str) -> None:
        print(text, file=self._stream, flush=True)
        self._said = monotonic()

    def _watch(self) -> None:
        while not self._ended.wait(max(0.0, self._said + self._patience - monotonic())):
            with self._lock:
                if monotonic() >= self._said + self._patience:
                    self._patience = min(2 * self._patience, _LONGEST)
                    self._said = monotonic()
                    if doing := self._doing():
                        self._write(f"… {doing}")


@contextmanager
def said_to_wait(stream: TextIO, what: str) -> Iterator[None]:
    """Say on `stream` that `what` is being done, for as long as it takes more than 2 s."""
    begun = monotonic()
    waiting = Waiting(stream, lambda: f"{what} ({monotonic() - begun:.0f} s)")
    try:
        yield
    finally:
        waiting.close()
