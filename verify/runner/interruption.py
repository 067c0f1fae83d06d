"""Ctrl-C and friends: noticed between two steps, so that nothing is left half written."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class RunStoppedError(Exception):
    """The run was asked to stop by a signal."""

    def __init__(self, signum: int) -> None:
        self.signum = signum
        super().__init__(f"interrupted by {signal.Signals(signum).name}")


class StopRequest:
    """Remembers the first signal that asked the run to stop."""

    signum: int | None = None

    def check(self) -> None:
        """Raise `RunStoppedError` if a signal came."""
        if self.signum is not None:
            raise RunStoppedError(self.signum)


@contextmanager
def listening() -> Iterator[StopRequest]:
    """Turn SIGINT, SIGTERM and SIGHUP into a `StopRequest` for the time of the block."""
    request = StopRequest()

    def note(signum: int, _frame: FrameType | None) -> None:
        request.signum = request.signum or signum

    before = {s: signal.getsignal(s) for s in _SIGNALS}
    for s in _SIGNALS:
        if before[s] != signal.SIG_IGN:  # nohup stays nohup
            signal.signal(s, note)
    try:
        yield request
    finally:
        for s, handler in before.items():
            signal.signal(s, handler)
