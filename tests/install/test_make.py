"""The make targets: help, and a failing test is never lost."""

import subprocess

import pytest

# Stands for pytest: one exit code for the claims about time, another for the rest.
PYTEST = """#!/bin/bash
case "$*" in
    *'-m timing and not heavy'*) exit {timed} ;;
    *'-m not timing and not heavy'*) exit {rest} ;;
esac
exit 99
"""


def make(checkout, *arguments):
    place, environment = checkout
    return subprocess.run(
        ["make", *arguments], cwd=place, env=environment, capture_output=True, text=True, timeout=60
    )


def test_make_alone_lists_every_target(checkout):
    helped = make(checkout)
    assert helped.returncode == 0
    for target in ("demo", "test", "heavy", "bench", "check", "clean", "lock"):
        assert f"  make {target}" in helped.stdout


@pytest.mark.parametrize(
    ("timed", "rest", "passes"),
    [(0, 0, True), (5, 0, True), (1, 0, False), (0, 1, False), (5, 5, False), (0, 5, False)],
)
def test_make_test_passes_only_if_both_runs_do(checkout, timed, rest, passes):
    # 5 is pytest's "nothing collected": fine for the claims about time, not for the tests.
    place, _ = checkout
    (place / ".ci/setup").write_text("#!/bin/sh\n")
    python = place / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTEST.format(timed=timed, rest=rest))
    python.chmod(0o755)
    assert (make(checkout, "test").returncode == 0) is passes
