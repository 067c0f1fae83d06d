"""Progress of a run: bars on a terminal, plain lines elsewhere; waits, in lines."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any, TextIO

from verify.cli.streams import unfiltered
from verify.printable import one_line
from verify.result import COMPILING, FORECAST, LOG, CaseResult, SolveRecord, Status
from verify.runner.comparing import comparison_label

_FIRST, _LONGEST = 2.0, 60.0  # s of silence before the first line, and before any other


class Waiting:
    """A thread that reports a wait after 2 s without a line, then ever more seldom.

    Parameters
    ----------
    stream : TextIO
    doing : callable
        Returns the current work in words; empty: no line.
    """

    def __init__(self, stream: TextIO, doing: Callable[[], str]) -> None:
        self._stream, self._doing = stream, doing
        self._changed, self._ended = threading.Condition(), False
        self._said, self._patience = monotonic(), _FIRST
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        """Write a line, and wait 2 s for the next again."""
        with self._changed:
            self._write(text)
            self._patience = _FIRST
            self._changed.notify()

    def close(self) -> None:
        """Say no more."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def _write(self, text: str) -> None:
        print(text, file=self._stream, flush=True)
        self._said = monotonic()

    def _watch(self) -> None:
        with self._changed:
            while not self._ended:
                if (left := self._said + self._patience - monotonic()) > 0.0:
                    self._changed.wait(left)
                    continue
                self._patience = min(2 * self._patience, _LONGEST)
                self._said = monotonic()
                if doing := self._doing():
                    self._write(f"… {doing}")


@contextmanager
def waiting_reported(stream: TextIO, what: str) -> Iterator[None]:
    """Report on `stream` that `what` is being done, if it takes more than 2 s."""
    begun = monotonic()
    waiting = Waiting(stream, lambda: f"{what} ({monotonic() - begun:.0f} s)")
    try:
        yield
    finally:
        waiting.close()


@contextmanager
def progress_on(stream: TextIO, expected: str = "") -> Iterator["Lines"]:
    """Give bars if `stream` is a terminal, else lines; write `expected` as the work begins."""
    display = (_Bars if stream.isatty() else Lines)(stream, expected)
    try:
        yield display
    finally:
        display.close()


def _solve_text(label: str, record: SolveRecord, reused: bool) -> str:
    if reused:
        return f"{label}: reused"
    took = f" in {record.wall:.1f} s" if record.wall is not None else ""
    if took and COMPILING in record.notes:
        took += f", of them {record.notes[COMPILING]} compiling kernels (first use)"
    if record.status is Status.SOLVED:
        finer = f"; {record.notes[FORECAST]}" if FORECAST in record.notes else ""
        return f"{label}: solved, {record.unknowns} unknowns{took}{finer}"
    where = f" (see {record.notes[LOG]})" if LOG in record.notes else ""
    return one_line(f"{label}: {record.status}{took}: {record.reason}{where}")


def _case_text(result: CaseResult) -> str:
    count = len(result.warnings)
    warned = f" ({count} warning{'s' * (count > 1)})" if count else ""
    return f"{result.case}: {result.verdict if result.verdicts else 'not judged'}{warned}"


class Lines:
    """Progress of a run and of work beside it: a line per finished solve, case, and for waits."""

    def __init__(self, stream: TextIO, expected: str) -> None:
        self.expected, self.done, self.total = expected, 0, 0
        self.running: dict[str, float] = {}
        self._open(stream)

    def doing(self, what: str) -> None:
        """Note the work that begins, before or after the solves."""
        self.running = {what: monotonic()}
        self._show()

    def planned(self, solves: int, cases: int) -> None:
        """Note how much there is to do; as of `verify.runner.work.Progress`, like what follows."""
        if not self.total:
            self.running = {}
            if self.expected:
                self.say(self.expected)
            self._begin(f"{solves} solves of {cases} case{'s' if cases != 1 else ''}")
        self.total = solves  # more or fewer than it seemed
        self._show(total=solves + cases)

    def started(self, label: str) -> None:
        """Note what begins."""
        self.running[label] = monotonic()
        self._show()

    def solved(self, label: str, record: SolveRecord, reused: bool) -> None:
        """Say how a solve ended."""
        self.done += 1
        self.running.pop(label, None)
        self._say_solve(_solve_text(label, record, reused), record)
        self._show(advance=1)

    def judged(self, result: CaseResult) -> None:
        """Say how a case was judged."""
        self.running.pop(comparison_label(result.case), None)
        self.say(_case_text(result))
        self._show(advance=1)

    def say(self, text: str) -> None:
        """Write a line."""
        self._waiting.say(text)

    def close(self) -> None:
        """Say and draw no more."""
        self._waiting.close()

    def _open(self, stream: TextIO) -> None:
        self._waiting = Waiting(stream, lambda: _oldest(self.running))

    def _begin(self, text: str) -> None:
        self.say(text)

    def _say_solve(self, text: str, record: SolveRecord) -> None:
        self.say(f"[{self.done}/{self.total}] {text}")

    def _show(self, **change: Any) -> None:
        """Draw what has changed: nothing, but for bars."""


def _oldest(running: dict[str, float]) -> str:
    """Return the longest work under way, with its seconds, and the number of others."""
    under_way = dict(running)  # another thread changes it
    if not under_way:
        return ""
    label = min(under_way, key=lambda one: under_way[one])
    more = f", {len(under_way) - 1} more beside it" if len(under_way) > 1 else ""
    return f"{label} ({monotonic() - under_way[label]:.0f} s{more})"


class _Bars(Lines):
    """A bar over the solves, with the one that runs now; failures above it."""

    def _open(self, stream: TextIO) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
        )

        text = TextColumn("{task.description}", markup=False)
        columns = (BarColumn(bar_width=30), MofNCompleteColumn(), TimeElapsedColumn(), text)
        self.bars = Progress(*columns, console=Console(file=unfiltered(stream)), transient=True)
        self.task = self.bars.add_task("", total=None)
        self.bars.start()

    def close(self) -> None:
        self.bars.stop()

    def say(self, text: str) -> None:
        self.bars.console.print(text, markup=False, highlight=False)

    def _begin(self, text: str) -> None:
        """Say nothing: the bar does."""

    def _say_solve(self, text: str, record: SolveRecord) -> None:
        if record.status is not Status.SOLVED or "not end within" in record.notes.get(FORECAST, ""):
            self.say(text)

    def _show(self, **change: Any) -> None:
        oldest = min(self.running, key=lambda label: self.running[label], default="")
        more = f" (+{len(self.running) - 1})" if len(self.running) > 1 else ""
        self.bars.update(self.task, description=f"{oldest}{more}", **change)
