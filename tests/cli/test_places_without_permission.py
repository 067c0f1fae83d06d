"""A place that the user may not write is one line and exit code 2, whatever was to be written."""

import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest

from verify.cli.main import main

NOBODY = 65534  # may not read all of Python's own files either: load before becoming it


@contextmanager
def no_permission(folder):
    """Take the right to write in a folder away, from root as well."""
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    root = os.geteuid() == 0
    if root:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)
        for path in (folder, *folder.rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)


@pytest.fixture
def folder():
    """Make a folder that all users can reach, which those of pytest are not."""
    made = Path(tempfile.mkdtemp())
    made.chmod(0o755)
    yield made
    shutil.rmtree(made)


@pytest.mark.parametrize("place", [".", "new"], ids=["an export itself", "a folder in it"])
@pytest.mark.parametrize(
    "command", [["export", "statics/f1_patch"], ["study", "energy", "--quick"]], ids=lambda c: c[0]
)
def test_a_place_without_permission_is_refused_in_one_line(folder, capfd, command, place):
    assert main(["export", "statics/f1_patch", "--out", str(folder)]) == 0
    import verify.report.study_page
    import verify.study.energy  # noqa: F401

    before = sorted(folder.rglob("*"))
    capfd.readouterr()
    with no_permission(folder):
        code = main([*command, "--out", str(folder / place)])
    said = capfd.readouterr()
    assert code == 2
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith(f"verify: error: {folder}")
    assert sorted(folder.rglob("*")) == before


def test_a_place_that_no_command_asked_for_is_named_as_well(monkeypatch, capfd):
    """As a cache that belongs to another user."""

    def denied(_arguments):
        raise PermissionError(13, "Permission denied", "/a/cache/b")

    monkeypatch.setattr("verify.cli.schema_command.execute", denied)
    assert main(["schema"]) == 2
    assert capfd.readouterr().err == "verify: error: /a/cache/b: Permission denied\n"
