"""Calls of functions as jobs: each in a watched process, and kept, so that it is made once.

For measurements of studies that are no comparison of a run: systems of slivers, trials of the
reference, tables; and for loading solvers. ``python -m verify.runner.tasks TASK.json`` makes one.
Its result lies beside, with the key of the call and of its code.
"""

import json
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from typing import Any, get_type_hints

from verify.errors import InputError
from verify.files import read_json, write_json, write_whole
from verify.printable import words_of
from verify.processes import die_with_parent, memory_limit, start_server
from verify.result import checked
from verify.runner.child import Child, Ending, death, watch_all
from verify.runner.directory import emptied, folder_name
from verify.runner.fingerprint import code_digest, code_of_solver, digest_of, source_of
from verify.solvers import find_solver
from verify.solvers.interface import is_built_in, solver_in

_FOUND, _WHY = "found.json", "why.json"
_LONGEST_NAME = 80


@dataclass(frozen=True)
class Task:
    """Call of a function of a module; of two equal ones one is made.

    Attributes
    ----------
    name : str
        In messages.
    function : callable
        Its annotation says what it returns: numbers, texts, and dataclasses of them.
    arguments : mapping of str to object
        Plain data.
    solvers : tuple of str
        That it runs: its result depends on their code.
    fresh : bool
        Whether it needs a Python of its own, as solvers of others among `solvers` do.
    """

    name: str
    function: Callable[..., Any]
    arguments: Mapping[str, Any]
    solvers: tuple[str, ...] = ()
    fresh: bool = False

    def question(self) -> dict[str, Any]:
        """Return the call as plain data."""
        place = {"module": self.function.__module__, "function": self.function.__name__}
        return {**place, "arguments": self.arguments}

    def key(self) -> str:
        """Return the hash of the call and of all code that it runs."""
        code = [code_digest(__name__, self.function.__module__)]
        for name in self.solvers:
            guest = "" if is_built_in(name) else source_of(find_solver(solver_in(name)))
            code += [code_of_solver(name), guest]
        return digest_of([self.question(), code])


@dataclass(frozen=True)
class Limits:
    """How many tasks run side by side, and the limits of each: wall time (s), memory (bytes)."""

    jobs: int = 1
    timeout: float = 1800.0
    memory: float | None = None

    @property
    def bytes(self) -> float:
        """Limit of memory: by default 80 % of the machine's, shared."""
        return memory_limit(self.memory, self.jobs)


@dataclass(frozen=True)
class Failure:
    """Why a task has no result: its exception, or how its process died."""

    reason: str


def made(
    tasks: Sequence[Task],
    folder: Path,
    announce: Callable[[str], None] = lambda text: None,
    limits: Limits | None = None,
    look: Callable[[], None] = lambda: None,
    may_fail: bool = False,
) -> list[Any]:
    """Make the tasks that are not kept in `folder`; return their results.

    In the end the folders of other tasks are removed from it.

    Parameters
    ----------
    tasks : sequence of Task
    folder : Path
        Each has a folder of its own in it.
    announce : callable
        Told which task has ended.
    limits : Limits, optional
    look : callable
        Called again and again; an exception of it ends all tasks.
    may_fail : bool
        Whether a task that failed has a `Failure` as its result.

    Raises
    ------
    ChildProcessError
        If a task fails that may not; the results of the others are kept.
    """
    limits, found = limits or Limits(), dict[int, Any]()
    places = [folder / _folder_name(task) for task in tasks]
    for number, (task, place) in enumerate(zip(tasks, places, strict=True)):
        if (place / _FOUND).exists() and (known := _kept(task, place)) is not None:
            found[number] = known
    waiting = [number for number in range(len(tasks)) if number not in found]

    def ended(place: int, ending: Ending) -> None:
        number = waiting[place]
        found[number] = _ended(tasks[number], places[number], ending, limits)
        announce(f"{tasks[number].name}: {len(found)} of {len(tasks)} parts")

    start_server()
    starts = [partial(_started, tasks[number], places[number], limits) for number in waiting]
    watch_all(starts, ended, limits.jobs, look)
    for other in folder.glob("*/task.json"):
        if other.parent not in places:
            rmtree(other.parent)
    failed = [number for number in sorted(found) if isinstance(found[number], Failure)]
    if failed and not may_fail:
        raise ChildProcessError(f"{tasks[failed[0]].name}: {found[failed[0]].reason}")
    return [found[number] for number in range(len(tasks))]


def main(task_file: Path) -> None:
    """Make the task of a file, and write beside it the result, or why there is none."""
    die_with_parent()
    task = read_json(task_file)
    try:
        function = getattr(import_module(task["module"]), task["function"])
        content = {"key": task["key"], "found": function(**task["arguments"])}
        # numbers that are not finite stay what they are
        write_whole(task_file.with_name(_FOUND), json.dumps(content, default=_plain))
    except Exception as problem:  # a guest may raise anything
        traceback.print_exc()
        write_json({"reason": words_of(problem)}, task_file.with_name(_WHY))


def _folder_name(task: Task) -> str:
    return f"{folder_name(task.name)[:_LONGEST_NAME]}-{digest_of(task.question())[:8]}"


def _started(task: Task, place: Path, limits: Limits) -> Child:
    emptied(place)
    own = not task.fresh and all(map(is_built_in, task.solvers))
    write_json({**task.question(), "key": task.key()}, place / "task.json")
    files = place / "task.json", place / "log.txt"
    return Child(__name__, *files, limits.timeout, limits.bytes, own=own)


def _kept(task: Task, place: Path) -> Any:
    """Return a result that is kept; None if it is missing, damaged, or of another call or code."""
    try:
        content = read_json(place / _FOUND)
        if content.get("key") != task.key():
            return None
        kind = get_type_hints(task.function)["return"]
        return checked(kind, content["found"], "answer", str(place))
    except (InputError, KeyError):
        return None


def _ended(task: Task, place: Path, ending: Ending, limits: Limits) -> Any:
    if (known := _kept(task, place)) is not None:
        return known
    try:
        return Failure(str(read_json(place / _WHY)["reason"]))
    except (InputError, KeyError):
        _, why = death(place / "log.txt", ending, limits.timeout, limits.bytes)
        return Failure(why)


def _plain(value: Any) -> Any:
    """Return plain data for a dataclass or a number of numpy."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return value.tolist()


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
