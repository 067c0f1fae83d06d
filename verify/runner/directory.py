"""The run directory: who may write into it, and where things lie in it.

::

    DIR/.lock                              held while a run writes
    DIR/run.json                           command, options, cases, provenance
    DIR/cases/<case, / as __>/scene.json   the case as it was run
                              result.json  its `CaseResult`
                              <solver>-<level>/solution.json|.vtu, record.json, levels, log.txt
"""

import errno
import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.result_files import folder_of_case
from verify.whole_files import asked_place

RUN_SCHEMA = 1
# files by which a process says what is needed if it dies: the solve that a comparison is at, and
# how many levels a solver has that takes the case
JUDGING, LEVELS = "judging", "levels"
_IDENTITY = ("cases", "options_of_result")


class RunDirectory:
    """Paths inside a run directory."""

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def run_file(self) -> Path:
        """Record of the run as a whole."""
        return self.root / "run.json"

    def case_folder(self, case: str) -> Path:
        """Folder of a case."""
        return self.root / "cases" / folder_of_case(case)

    def solve_folder(self, case: str, solver: str, level: int) -> Path:
        """Folder of one solve."""
        return self.case_folder(case) / f"{folder_name(solver)}-{level}"


def folder_name(solver: str) -> str:
    """Return the name of a solver as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9_.+-]", "_", solver)


@contextmanager
def claimed(root: Path, identity: dict[str, Any]) -> Iterator[RunDirectory]:
    """Hold `root` for one run, new or resumed; nothing is touched if that must not be.

    Parameters
    ----------
    root : Path
        The run directory; created if it does not exist.
    identity : dict
        ``cases`` and ``options_of_result``: what a run that is resumed must have in common.

    Raises
    ------
    InputError
        If `root` is a file or holds something else, if another run holds it, or if it holds a
        run with other cases or options.
    """
    found = _contents(root)
    if found - {".lock", "run.json.partial"} and "run.json" not in found:
        raise InputError("not empty and not a run; give --out a new directory", str(root))
    try:
        with asked_place(root):
            root.mkdir(parents=True, exist_ok=True)
            # inheritable would let an orphaned solver keep the lock; Python's default is not to
            lock = os.open(root / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    except InputError as error:
        raise InputError(f"{error}; give --out a folder that can be") from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise InputError(f"cannot be locked ({error.strerror})", str(root)) from None
            raise InputError(
                "another run is writing into it; wait, or give --out another", str(root)
            ) from None
        _check_same_run(root, identity)
        yield RunDirectory(root)
    finally:
        os.close(lock)


def emptied(folder: Path, kept: tuple[str, ...] = ()) -> None:
    """Make `folder`, or remove all that is in it but what is `kept`."""
    folder.mkdir(parents=True, exist_ok=True)
    for leftover in folder.iterdir():
        if leftover.name in kept:
            continue
        if leftover.is_dir() and not leftover.is_symlink():
            shutil.rmtree(leftover)
        else:
            leftover.unlink()


def write_run(directory: RunDirectory, record: dict[str, Any]) -> None:
    """Write ``run.json``."""
    write_json({"schema": RUN_SCHEMA, **record}, directory.run_file)


def _contents(root: Path) -> set[str]:
    try:
        return {path.name for path in root.iterdir()}
    except FileNotFoundError:
        return set()
    except NotADirectoryError:
        raise InputError("is a file; expected a directory for the run", str(root)) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", str(root)) from None


def _check_same_run(root: Path, identity: dict[str, Any]) -> None:
    file = root / "run.json"
    if not file.exists():
        return
    before = read_json(file)
    if before.get("schema") != RUN_SCHEMA:
        raise InputError(f"not a run of schema {RUN_SCHEMA}; give --out a new directory", str(file))
    changed = [key for key in _IDENTITY if before.get(key) != identity[key]]
    if changed:
        what = {"cases": "cases", "options_of_result": "solvers, repetitions or parameters"}
        words = " and ".join(what[key] for key in changed)
        raise InputError(
            f"holds a run with other {words}; its own command resumes it "
            f"({before.get('command', 'unknown')}), or give --out a new directory",
            str(root),
        )
