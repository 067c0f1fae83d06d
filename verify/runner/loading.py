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
from functools import partial
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.processes import die_with_parent
from verify.runner.child import Child, Ending, telling_line, watch_all
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
    groups: dict[str, list[str]] = {}
    for name in waiting:
        groups.setdefault(solver_in(name), []).append(name)
    found, order = dict.fromkeys(names, Loaded()), list(groups)
    with tempfile.TemporaryDirectory(prefix="verify-") as folder:
        places = [Path(folder, str(number)) for number in range(len(order))]

        def start(solver: str, place: Path) -> Child:
            return _started(solver, {name: given[name] for name in groups[solver]}, place, options)

        def ended(number: int, _ending: Ending) -> None:
            for name in groups[order[number]]:
                found[name] = _answer(name, places[number] / "log.txt", options)

        starts = [partial(start, *one) for one in zip(order, places, strict=True)]
        watch_all(starts, ended, options.jobs, check)
    return found


def _started(solver: str, parameters: Mapping[str, Any], place: Path, options: Options) -> Child:
    place.mkdir()
    question = place / "question.json"
    write_json({"solver": solver, "parameters": parameters}, question)
    least, most = _SECONDS
    limit = min(most, max(least, options.timeout))
    memory = options.memory or 0.8 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    own = is_built_in(solver)
    return Child("verify.runner.loading", question, place / "log.txt", limit, memory, own=own)


def _answer(name: str, log: Path, options: Options) -> Loaded:
    try:
        answer = read_json(log.with_name("answer.json"))
    except InputError:
        answer = {"error": f"could not be loaded: {telling_line(log)}"}
    if bad := answer.pop("bad_parameters", {}).get(name):
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


def _loaded(name: str, parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Load a solver; check its parameters, by the names under which it is asked for."""
    from verify.solvers import check_parameters, find_solver

    if ":" in name:
        sys.path.append(os.getcwd())
    try:
        solver = find_solver(name)
    except InputError as error:
        return {"error": str(error)}
    bad = {}
    for asked, given in parameters.items():
        try:
            check_parameters(name, solver, given)
        except InputError as error:
            bad[asked] = str(error)
    # ours is known by its code
    return {"source": "" if module_of(name) else source_of(solver), "bad_parameters": bad}


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
