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
    ("taken", "passes", "outcome", "calls"),
    [
        (0.0, 1, "passed", 1),
        (0.9, 1, "passed", 1),
        (0.9, 2, "passed", 2),
        (0.9, 9, "skipped", 3),
        (0.0, 2, "failed", 1),
    ],
)
def test_a_claim_fails_only_on_a_quiet_machine(
    pytester, monkeypatch, taken, passes, outcome, calls
):
    monkeypatch.delenv("VERIFY_SHARED_MACHINE", raising=False)
    found, count = run(pytester, taken, passes)
    found.assert_outcomes(**{outcome: 1})
    assert count == calls
    if outcome == "skipped":
        found.stdout.fnmatch_lines(["*undecided: other programs took 0.9 cores*"])


@pytest.mark.parametrize(
    ("passes", "breaks", "outcome", "calls"),
    [(2, False, "passed", 2), (9, False, "skipped", 3), (9, True, "failed", 1)],
)
def test_on_a_shared_machine_a_claim_is_undecided_and_an_error_is_one(
    pytester, monkeypatch, passes, breaks, outcome, calls
):
    monkeypatch.setenv("VERIFY_SHARED_MACHINE", "1")
    found, count = run(pytester, 0.0, passes, breaks)
    found.assert_outcomes(**{outcome: 1})
    assert count == calls
    if outcome == "skipped":
        found.stdout.fnmatch_lines(["*undecided: assert 3 == 9, 3 times on a shared machine*"])
