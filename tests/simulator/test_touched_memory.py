"""The steps of a replay wait for no memory: its pages have been touched before the first."""

import platform

import pytest
from test_hand_under_the_knife import slashed

from verify.simulator import Session

resource = pytest.importorskip("resource", reason="page faults are counted by POSIX systems")


def faults() -> int:
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="said of glibc's allocator only")
def test_a_step_that_cuts_touches_hardly_a_fresh_page(hand) -> None:
    """Without room made beforehand some steps touch 200 pages and more, 3 to 13 microseconds each.

    What is left is the interpreter's own: it takes room for its small objects in its own way. Seen:
    15 at most in a step, 108 in all, and nothing in a third replay; the bounds lie between.
    """
    Session(slashed(hand), account=False, spread=True).step()  # loads what is compiled
    session = Session(slashed(hand), account=False, spread=True)
    fresh = []
    while not session.finished:
        before = faults()
        session.step()
        fresh.append(faults() - before)
    assert session.records[-1].split > 170
    assert max(fresh) < 64
    assert sum(fresh) < 300
