"""The make targets: help, and a failing test is never lost."""

import subprocess

import pytest

# Stands for pytest: an exit code for the claims about time, another for the rest.
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
    for target in ("demo", "test", "heavy", "bench", "check", "size", "clean", "lock"):
        assert f"  make {target}" in helped.stdout


@pytest.mark.parametrize("timed", [0, 1])
@pytest.mark.parametrize("rest", [0, 1])
def test_no_claim_about_time_decides_make_test(checkout, timed, rest):
    place, _ = checkout
    (place / ".ci/setup").write_text("#!/bin/sh\n")
    python = place / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTEST.format(timed=timed, rest=rest))
    python.chmod(0o755)
    assert (make(checkout, "test").returncode == 0) is (rest == 0)
    assert (make(checkout, "bench").returncode == 0) is (timed == 0)
