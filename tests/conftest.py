"""Fixtures of all tests: a cache of their own, and claims about time that a busy machine spoils."""

import gc
import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

FOLDER = Path(__file__).resolve().parent
_VARIABLE = "VERIFY_CACHE"

ATTEMPTS = 3  # at a claim about time that fails while other programs run
BUSY = 0.1  # cores; other programs that take more than this can spoil a timing
# a virtual machine beside others: who empties its caches and lowers its clock is not to be seen
SHARED = "VERIFY_SHARED_MACHINE"


def pytest_configure(config):
    """Give the session a cache of its own; the workers of xdist inherit it."""
    if not hasattr(config, "workerinput"):
        config.cache_of_session = os.environ[_VARIABLE] = tempfile.mkdtemp(prefix="verify-cache-")


def pytest_unconfigure(config):
    """Remove it."""
    if folder := getattr(config, "cache_of_session", None):
        shutil.rmtree(folder, ignore_errors=True)


def pytest_collection_finish():
    """Look for garbage in what tests make alone: all that is imported lives on."""
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    """Repeat a claim about time that fails on a busy machine; then call it undecided, not wrong."""
    if item.get_closest_marker("timing") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in range(1, ATTEMPTS + 1):
        clock, others = time.monotonic(), time_of_others()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        taken = (time_of_others() - others) / max(time.monotonic() - clock, 1e-9)
        failed = [report for report in reports if report.when == "call" and report.failed]
        disturbed = taken > BUSY or (SHARED in os.environ and _is_claim(failed))
        if not failed or not disturbed:
            break
        if attempt == ATTEMPTS:
            reason = f"undecided: other programs took {taken:.1f} cores, {ATTEMPTS} times"
            if taken <= BUSY:
                reason = f"undecided: {_said(failed)}, {ATTEMPTS} times on a shared machine"
            failed[0].outcome = "skipped"
            failed[0].longrepr = (str(item.path), item.location[1], reason)
        else:
            item._initrequest()
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _said(failed):
    crash = getattr(failed[0].longrepr, "reprcrash", None)
    return crash.message.split("\n", 1)[0] if crash else ""


def _is_claim(failed):
    """Whether an assertion failed and not the program: an error is one on every machine."""
    return bool(failed) and _said(failed).startswith(("assert", "AssertionError"))


def time_of_others():
    """Processor time in s that programs other than this one and its children have taken so far."""
    try:
        words = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]
    except OSError:  # not Linux: nobody else is seen
        return 0.0
    user, nice, system, _, _, irq, softirq, stolen = map(int, words)
    every = (user + nice + system + irq + softirq + stolen) / os.sysconf("SC_CLK_TCK")
    own = os.times()
    return every - (own.user + own.system + own.children_user + own.children_system)
