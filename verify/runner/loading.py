"""Loading of solvers before anything runs, each in a process of its own.

To load a solver means to import it, and some start MPI, hang or die. Solvers of the project are
loaded only if a user names them or sets their parameters: packages that a case wants may be
missing.
"""

import tempfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.runner.fingerprint import source_of
from verify.runner.selection import Options
from verify.runner.tasks import Failure, Limits, Task, made
from verify.solvers.interface import is_built_in, module_of, parameters_of, solver_in

_SECONDS = (60.0, 300.0)  # for importing a solver: at least, at most


@dataclass(frozen=True)
class Loaded:
    """A solver as it was loaded.

    Attributes
    ----------
    error : str
        Why there is no such solver here; empty if there is.
    source : str
        Digest of the file that defines it and of the files that it depends on.
    bad_parameters : dict of str to str
        Faults of parameters, by the solver's name with its parameters.
    """

    error: str = ""
    source: str = ""
    bad_parameters: dict[str, str] = field(default_factory=dict)


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
    groups: dict[str, dict[str, Any]] = {}
    for name in names:
        if name in options.solvers or given[name] or not is_built_in(name):
            groups.setdefault(solver_in(name), {})[name] = given[name]
    tasks = [
        Task(name, load_solver, {"name": name, "parameters": own}, fresh=not is_built_in(name))
        for name, own in groups.items()
    ]
    least, most = _SECONDS
    limits = Limits(options.jobs, min(most, max(least, options.timeout)), options.memory)
    with tempfile.TemporaryDirectory(prefix="verify-") as folder:
        answers = made(tasks, Path(folder), limits=limits, look=check, may_fail=True)
    found = dict.fromkeys(names, Loaded())
    for own, answer in zip(groups.values(), answers, strict=True):
        found |= {name: _checked(name, answer, options) for name in own}
    return found


def _checked(name: str, found: Loaded | Failure, options: Options) -> Loaded:
    if isinstance(found, Failure):
        found = Loaded(f"could not be loaded: {found.reason}")
    if bad := found.bad_parameters.get(name):
        raise InputError(bad, "--solver" if " " in name else "--set")
    if found.error and name in options.solvers:
        raise InputError(found.error, "--solver")
    return found


def load_solver(name: str, parameters: Mapping[str, Mapping[str, Any]]) -> Loaded:
    """Load a solver; check its parameters, by the names with which a user gives them."""
    from verify.solvers import check_parameters, find_solver

    try:
        solver = find_solver(name)
    except InputError as error:
        return Loaded(str(error))
    bad = {}
    for named, given in parameters.items():
        try:
            check_parameters(name, solver, given)
        except InputError as error:
            bad[named] = str(error)
    # ours is known by its code
    return Loaded(source="" if module_of(name) else source_of(solver), bad_parameters=bad)
