"""Claims about time: repeated beside other programs, then undecided; wrong on a quiet machine."""

import os
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

CONFTEST = (Path(__file__).parent / "conftest.py").read_text(encoding="utf-8")
# a test that passes when it is called for the `passes`-th time; its fixture serves once
CLAIM = """
import pathlib
import pytest

@pytest.fixture
def fresh():
    return []

@pytest.mark.timing
def test_claim(fresh):
    fresh.append(0)
    calls = pathlib.Path("calls")
    count = len(calls.read_text()) + 1 if calls.exists() else 1
    calls.write_text("x" * count)
    assert len(fresh) == 1
    if {breaks}:
        raise OSError("no file")
    assert count == {passes}
"""


@pytest.fixture(autouse=True)
def _inner_session(monkeypatch):
    """Bring back the variable that the inner session sets and leaves to a folder that is gone."""
    monkeypatch.setenv("VERIFY_CACHE", os.environ["VERIFY_CACHE"])
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # most of what a session takes


def run(pytester, taken, passes, breaks=False):
    """Run the claim where other programs take so many cores."""
    clock = f"\ndef time_of_others():\n    return {taken} * time.monotonic()\n"
    pytester.makeconftest(CONFTEST + clock)
    pytester.makeini("[pytest]\nmarkers = timing: claims about time\n")
    pytester.makepyfile(CLAIM.format(passes=passes, breaks=breaks))
    found = pytester.runpytest_inprocess("-rs", "-p", "no:cacheprovider")
    return found, len((pytester.path / "calls").read_text())


@pytest.mark.parametrize(
    ("shared", "taken", "passes", "breaks", "outcome", "calls"),
    [
        (False, 0.9, 1, False, "passed", 1),
        (False, 0.9, 2, False, "passed", 2),
        (False, 0.9, 9, False, "skipped", 3),
        (False, 0.0, 2, False, "failed", 1),
        # on a shared machine others are not to be seen; an error is one
        (True, 0.0, 2, False, "passed", 2),
        (True, 0.0, 9, False, "skipped", 3),
        (True, 0.0, 9, True, "failed", 1),
    ],
)
def test_a_claim_fails_only_on_a_quiet_machine(
    pytester, monkeypatch, shared, taken, passes, breaks, outcome, calls
):
    if shared:
        monkeypatch.setenv("VERIFY_SHARED_MACHINE", "1")
    else:
        monkeypatch.delenv("VERIFY_SHARED_MACHINE", raising=False)
    found, count = run(pytester, taken, passes, breaks)
    found.assert_outcomes(**{outcome: 1})
    assert count == calls
    said = (
        "assert 3 == 9, 3 times on a shared machine" if shared else "other programs took 0.9 cores"
    )
    if outcome == "skipped":
        found.stdout.fnmatch_lines([f"*undecided: {said}*"])
