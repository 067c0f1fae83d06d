"""Loading of solvers before anything runs, each in a process: ``python -m verify.runner.loading``.

To load a solver means to import it, and some start MPI, hang or die. Those of the project are
loaded only if they are asked for by name or have parameters: what a case wants may be missing.
"""

import inspect
import os
import sys
import tempfile
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import sleep
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.processes import die_with_parent
from verify.runner.child import POLL_SECONDS, Child, telling_line
from verify.runner.fingerprint import digest_of, file_digest
from verify.runner.selection import Options
from verify.solvers.interface import is_built_in, module_of, parameters_of, solver_in

_SECONDS = (60.0, 300.0)  # for importing a solver: at least, at most


@dataclass(frozen=True)
class Loaded:
    """What loading a solver has found.

    Attributes
    ----------
    error : str
        Why there is no such solver here; empty if there is.
    source : str
        Digest of the file that defines it, and of those that it says its answers depend on.
    """

    error: str = ""
    source: str = ""


def load_solvers(
    names: Collection[str], options: Options, check: Callable[[], None]
) -> dict[str, Loaded]:
    """Load solvers in processes of their own and check their parameters.

    `check` is called again and again, and may raise to stop it.

    Raises
    ------
    InputError
        If `options` name a solver that does not work here, or a parameter that it does not have.
    """
    given = {name: parameters_of(name, options.parameters) for name in names}
    waiting = [
        name for name in names if name in options.solvers or given[name] or not is_built_in(name)
    ]
    found = dict.fromkeys(names, Loaded())
    running: dict[str, Child] = {}
    with tempfile.TemporaryDirectory(prefix="verify-") as folder:
        try:
            while waiting or running:
                check()
                while waiting and len(running) < options.jobs:
                    name = waiting.pop(0)
                    place = Path(folder, str(len(waiting)))
                    place.mkdir()
                    running[name] = _started(name, given[name], place, options)
                for name, child in list(running.items()):
                    if child.poll() is not None:
                        del running[name]
                        found[name] = _answer(name, child.log, options)
                sleep(POLL_SECONDS)
        finally:
            for child in running.values():
                child.kill()
    return found


def _started(name: str, parameters: Mapping[str, Any], place: Path, options: Options) -> Child:
    question = place / "question.json"
    write_json({"solver": name, "parameters": dict(parameters)}, question)
    least, most = _SECONDS
    limit = min(most, max(least, options.timeout))
    memory = options.memory or 0.8 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return Child(
        "verify.runner.loading", question, place / "log.txt", limit, memory, own=is_built_in(name)
    )


def _answer(name: str, log: Path, options: Options) -> Loaded:
    try:
        answer = read_json(log.with_name("answer.json"))
    except InputError:
        answer = {"error": f"could not be loaded: {telling_line(log)}"}
    if bad := answer.get("bad_parameter"):
        raise InputError(bad, "--solver" if " " in name else "--set")
    if "error" in answer and name in options.solvers:
        raise InputError(answer["error"], "--solver")
    return Loaded(**answer)


def main(question: Path) -> None:
    """Load the solver that `question` names; write ``answer.json`` beside it."""
    die_with_parent()
    question = question.resolve()  # a solver may change the working directory
    asked = read_json(question)
    write_json(_loaded(asked["solver"], asked["parameters"]), question.with_name("answer.json"))


def _loaded(name: str, parameters: Mapping[str, Any]) -> dict[str, str]:
    from verify.solvers import check_parameters, find_solver

    if ":" in name:
        sys.path.append(os.getcwd())
    try:
        solver = find_solver(solver_in(name))
    except InputError as error:
        return {"error": str(error)}
    try:
        check_parameters(solver_in(name), solver, parameters)
    except InputError as error:
        return {"bad_parameter": str(error)}
    return {"source": "" if module_of(name) else source_of(solver)}  # ours is known by its code


def source_of(solver: Any) -> str:
    """Return the digest of the file that defines a solver, and of those that it says it needs."""
    with suppress(OSError, TypeError):  # of no file, or of one that is not there
        source = inspect.getsourcefile(type(solver))
        files = [Path(source)] if source else []
        digests = [file_digest(path) for path in [*files, *getattr(solver, "files", ())]]
        return digests[0] if len(digests) == 1 else digest_of(digests) if digests else ""
    return ""


if __name__ == "__main__":
    main(Path(sys.argv[1]))
