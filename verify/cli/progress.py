"""Progress of a run: bars on a terminal, plain lines elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any, Protocol, TextIO

from verify.cli.streams import unfiltered
from verify.printable import one_line
from verify.result import COMPILING, LOG, CaseResult, SolveRecord, Status
from verify.runner import Progress

__all__ = ["ClosableProgress", "progress_on"]


class ClosableProgress(Progress, Protocol):
    """A progress display that can leave the screen."""

    def close(self) -> None:
        """Stop drawing."""
        ...


@contextmanager
def progress_on(stream: TextIO, expected: str = "") -> Iterator[ClosableProgress]:
    """Give bars if `stream` is a terminal, else lines; say what is expected as the work begins."""
    display: ClosableProgress = (_Bars if stream.isatty() else _Lines)(stream, expected)
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
        return f"{label}: solved, {record.unknowns} unknowns{took}"
    where = f" (see {record.notes[LOG]})" if LOG in record.notes else ""
    return one_line(f"{label}: {record.status}{took}: {record.reason}{where}")


def _case_text(result: CaseResult) -> str:
    count = len(result.warnings)
    warned = f" ({count} warning{'s' * (count > 1)})" if count else ""
    return f"{result.case}: {result.verdict if result.verdicts else 'not judged'}{warned}"


class _Lines:
    """One line per finished solve and case."""

    def __init__(self, stream: TextIO, expected: str) -> None:
        self.stream, self.expected, self.done, self.total = stream, expected, 0, 0

    def planned(self, solves: int, cases: int) -> None:
        self.total = solves
        if self.expected:
            self._say(self.expected)
        self._say(f"{solves} solves of {cases} case{'s' if cases != 1 else ''}")

    def started(self, label: str) -> None:
        """Say nothing: a line per event that ended is enough in a log."""

    def solved(self, label: str, record: SolveRecord, reused: bool) -> None:
        self.done += 1
        self.total = max(self.total, self.done)  # a reference may get further levels
        self._say(f"[{self.done}/{self.total}] {_solve_text(label, record, reused)}")

    def judged(self, result: CaseResult) -> None:
        self._say(_case_text(result))

    def close(self) -> None:
        """Nothing is drawn that would have to go."""

    def _say(self, text: str) -> None:
        print(text, file=self.stream, flush=True)


class _Bars:
    """A bar over the solves, with what runs now, above it what went wrong."""

    def __init__(self, stream: TextIO, expected: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as RichProgress

        columns = (
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
        )
        self.bars = RichProgress(*columns, console=Console(file=unfiltered(stream)), transient=True)
        self.task: Any = None
        self.expected = expected
        self.running: dict[str, float] = {}

    def planned(self, solves: int, cases: int) -> None:
        if self.expected:
            self._say(self.expected)
        self.task = self.bars.add_task("", total=solves + cases)
        self.bars.start()

    def started(self, label: str) -> None:
        self.running[label] = monotonic()
        self._describe()

    def solved(self, label: str, record: SolveRecord, reused: bool) -> None:
        self.running.pop(label, None)
        if record.status is not Status.SOLVED:
            self._say(_solve_text(label, record, reused))
        self._describe(1)

    def judged(self, result: CaseResult) -> None:
        self.running.pop(f"{result.case} · comparison", None)
        self._say(_case_text(result))
        self._describe(1)

    def close(self) -> None:
        self.bars.stop()

    def _say(self, text: str) -> None:
        self.bars.console.print(text, markup=False, highlight=False)

    def _describe(self, advance: int = 0) -> None:
        oldest = min(self.running, key=lambda label: self.running[label], default="")
        more = f" (+{len(self.running) - 1})" if len(self.running) > 1 else ""
        self.bars.update(self.task, description=f"{oldest}{more}", advance=advance)
