"""The interface that every solver implements, and how a solver is found by its name.

A name may bring parameters, ``xfem tip=partial mass=consistent``: a solver of its own, with rows
and verdicts beside ``xfem``.
"""

import json
import os
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from inspect import Parameter, signature
from math import isfinite
from pathlib import Path
from traceback import extract_tb
from typing import Any, Protocol

import numpy as np

from verify.errors import InputError, instead
from verify.printable import one_line, shown, words_of
from verify.scene import Equilibrium, Scene
from verify.scene.strict import nearest
from verify.scene.tables import starts_open
from verify.solution import Solution

_LONGEST = 400  # characters of a refusal: it stands in every record of the solver

# module:class, imported only when asked for, so that one solver's missing dependency
# (FEniCSx, say) does not hinder the others
_BUILT_IN = {
    "xfem": "verify.solvers.xfem:XfemSolver",
    "conforming": "verify.solvers.conforming:ConformingSolver",
    "mass_spring": "verify.solvers.methods_adapter:MassSpringSolver",
    "reference": "verify.solvers.conforming:ReferenceSolver",
}
# of the class `MethodSolver` each, which is told the name
_METHODS = (
    "subdivision", "snapping", "snapping_subdivision", "removal", "removal_refined",
    "virtual_node", "virtual_node_arbitrary", "uncut",
)  # fmt: skip
_BUILT_IN |= dict.fromkeys(_METHODS, "verify.solvers.methods_adapter:MethodSolver")
_WITHOUT = {"conforming": "dolfinx", "reference": "dolfinx"}  # what they do not load without
_GROUP = "verify.solvers"
# programs of others, a folder each, of the class named here, which is told the name
_PROGRAMS = Path(__file__).resolve().parents[1] / "foreign" / "programs"
_FOREIGN = "verify.foreign.installing:ForeignProgram"
_ASKED = ("refuses", "levels", "solve")  # methods that every solver has
MOST_LEVELS = 32  # the coarsest cell halved so often is of round-off size


class Solver(Protocol):
    """What a solver must offer. A solver never sees the reference and never grades itself.

    It may offer ``system(scene, level, **parameters) -> verify.system.System`` too: stiffness, mass
    and held unknowns of the body at rest with all cuts open, for the parameters of `solve`. Studies
    take condition numbers and critical explicit steps from it. A collection ``contact`` says where
    it knows contact of the faces of cuts, see `refused_contact`; without it no such scene comes.
    """

    name: str

    def refuses(self, scene: Scene) -> str | None:
        """Say why this solver cannot do `scene`, in one sentence, or None if it can."""

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels on which it can solve `scene`."""

    def solve(self, scene: Scene, level: int, repetitions: int = 1, **parameters: Any) -> Solution:
        """Solve `scene` on mesh `level` (0 is the coarsest).

        The first call inside a process compiles; timings of `repetitions` further calls go
        into ``Solution.timings`` phase by phase.

        Raises
        ------
        UnsupportedSceneError
            If `refuses` would give a reason.
        InputError
            If something that the scene names (a mesh file) is bad.
        """


def refusal_of(solver: Solver, scene: Scene) -> str | None:
    """Return why a solver cannot do a scene: what it answers itself, or that it has no contact.

    Raises
    ------
    InputError
        If it is neither a sentence nor None.
    """
    answer: Any = solver.refuses(scene)
    if answer is not None and not isinstance(answer, str):
        raise InputError(f"refuses() gave {shown(answer)}; expected a sentence, or None")
    return one_line(answer, _LONGEST) if answer else refused_contact(solver, scene)


def refused_contact(solver: Any, scene: Scene) -> str | None:
    """Say which contact of the faces of cuts a solver lacks that a scene asks for, or None.

    A solver offers contact by its attribute ``contact``: the analyses that have it, "static" and
    "dynamic", and of those that have it at finite rotation too "static finite_rotation" and
    "dynamic finite_rotation"; "finite_rotation" is both.
    """
    if not scene.contact.closed:
        return None
    analysis, offered = scene.analysis, {*getattr(solver, "contact", ())}
    if "finite_rotation" in offered:
        offered |= {f"{kind} finite_rotation" for kind in offered}
    begins = isinstance(scene.initial, Equilibrium) and starts_open(scene.initial)
    asked = [analysis.kind, *(["static"] if begins and analysis.kind != "static" else [])]
    if analysis.kinematics != "linear":
        asked = [f"{kind} finite_rotation" for kind in asked]
    where = " and ".join(f"'{word}'" for word in asked if word not in offered)
    name = getattr(solver, "name", type(solver).__name__)
    return f"contact of the faces of a cut ({where}) is not offered by {name}" if where else None


def checked_levels(answer: Any) -> int:
    """Return what `Solver.levels` answered.

    Raises
    ------
    InputError
        If it is no number of mesh levels.
    """
    whole = isinstance(answer, int | np.integer) and not isinstance(answer, bool)
    if not whole or not 1 <= answer <= MOST_LEVELS:
        wanted = f"a whole number from 1 to {MOST_LEVELS}"
        raise InputError(f"levels() gave {shown(answer)}; expected {wanted}")
    return int(answer)


def is_built_in(name: str) -> bool:
    """Tell whether the solver called `name`, with parameters or without, comes with the project."""
    return solver_in(name) in _BUILT_IN


def is_installed(name: str) -> bool:
    """Tell whether what a solver of project needs is there; of another solver nothing is known."""
    solver = solver_in(name)
    needed = _WITHOUT.get(solver, "numba" if solver in _BUILT_IN else "sys")
    return find_spec(needed) is not None


def module_of(name: str) -> str | None:
    """Return the module that defines a solver of the project; None if another package does."""
    if solver_in(name) in _foreign_names():
        return _FOREIGN.partition(":")[0]
    return _BUILT_IN.get(solver_in(name), "").partition(":")[0] or None


def program_of(name: str) -> str | None:
    """Return the module of the program of a foreign solver of the project; else None."""
    own = solver_in(name)
    return f"verify.foreign.programs.{own}.program" if own in _foreign_names() else None


def _foreign_names() -> set[str]:
    return {path.parent.name for path in _PROGRAMS.glob("*/solver.toml")}


def solver_names() -> list[str]:
    """Names of all solvers: built in, foreign, and entry points of the group ``verify.solvers``."""
    points = (point.name for point in entry_points(group=_GROUP))
    return sorted({*_BUILT_IN, *_foreign_names(), *points})


def find_solver(name: str) -> Solver:
    """Find the solver called `name`.

    Parameters
    ----------
    name : str
        One of `solver_names`, or ``module:Class`` for a class of the user's own; without
        parameters, which each solve is given.

    Raises
    ------
    InputError
        If there is no such solver, it cannot be loaded, or what it needs is not installed.
    """
    with _loading(name):
        found = _class_of(name)
        told = name in _METHODS or name in _foreign_names()
        solver: Solver = found(name) if told else found()
    for method in _ASKED:
        if not callable(getattr(solver, method, None)):
            raise InputError(f"solver '{name}' has no {method}(); expected {', '.join(_ASKED)}")
    return solver


def _class_of(name: str) -> Any:
    if ":" in name and os.getcwd() not in sys.path:  # from where the command was started
        sys.path.append(os.getcwd())
    if ":" in name or name in _BUILT_IN or name in _foreign_names():
        module, _, attribute = _BUILT_IN.get(name, name if ":" in name else _FOREIGN).partition(":")
        if not module or not attribute:
            raise InputError(f"solver '{name}'; expected MODULE:CLASS")
        if (found := getattr(import_module(module), attribute, None)) is None:
            raise InputError(f"solver '{name}': no '{attribute}' in module '{module}'")
        return found
    points = {point.name: point for point in entry_points(group=_GROUP)}
    if name not in points:
        raise InputError(f"no solver '{name}'{nearest(name, solver_names())}")
    return points[name].load()


@contextmanager
def _loading(name: str) -> Iterator[None]:
    """Say what of a solver could not be loaded, where, and what was expected."""
    try:
        yield
    except InputError:
        raise
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if missing.partition(".")[0] in ("verify", "reference"):
            raise  # our own mistake, not a missing dependency
        if f"{name.partition(':')[0]}.".startswith(f"{missing}."):
            text = f"solver '{name}': no module '{missing}' in this folder or on PYTHONPATH"
            raise InputError(f"{text}; expected MODULE:CLASS") from None
        text = f"solver '{name}' needs '{missing}', which is not installed"
        raise InputError(text + ("" if name in _BUILT_IN else _place(error))) from None
    except (Exception, SystemExit) as error:  # of a guest, who may raise anything
        if name in _BUILT_IN:
            raise
        text = f"solver '{name}' cannot be loaded: {words_of(error)}{_place(error)}"
        raise InputError(f"{text}; expected a class that is made without arguments") from error


def _place(error: BaseException) -> str:
    """Find the file and line, outside this file, at which something raised."""
    if isinstance(error, SyntaxError):
        return f" ({error.filename}:{error.lineno})"
    frames = extract_tb(error.__traceback__)
    own = [one for one in frames if not one.filename.startswith(("<frozen", __file__))]
    return f" ({own[-1].filename}:{own[-1].lineno})" if own else ""


def check_parameters(name: str, solver: Solver, given: Mapping[str, Any]) -> None:
    """Raise `InputError` if the solver called `name` does not take the `given` parameters.

    One that takes any name (``**parameters``) is asked only if it lists further ``parameters``.
    Values are checked of those that stand in its ``choices``, if it has such.
    """
    taken, listed = signature(solver.solve).parameters, getattr(solver, "parameters", None)
    named = {name for name, one in taken.items() if one.kind is not Parameter.VAR_KEYWORD}
    known = {*named, *(listed or ())} - {"scene", "level", "repetitions"}
    for word in given:
        if said := instead(f"{name}.{word}"):
            raise InputError(said)
    for word in given if listed is not None or len(named) == len(taken) else ():
        if word not in known:
            raise InputError(f"{name} has no parameter '{word}'{nearest(word, known)}")
    check_choices(name, getattr(solver, "choices", {}), given)


def check_choices(
    name: str, choices: Mapping[str, Collection[Any]], given: Mapping[str, Any]
) -> None:
    """Raise `InputError` for the first `given` parameter that is none of its `choices`."""
    for word, known in choices.items():
        if word in given and given[word] not in tuple(known):
            expected = f"expected one of {', '.join(map(str, known))}"
            raise InputError(f"{name}.{word} = '{given[word]}'; {expected}")


# Such a name is a solver of its own, with rows and verdicts beside ``xfem``.


def one_name(asked: str) -> str:
    """Return `asked` with single spaces: how records and reports name this solver."""
    return " ".join(asked.split())


def solver_in(name: str) -> str:
    """Return the solver's own name, without parameters."""
    return name.partition(" ")[0]


def parameters_in(name: str) -> dict[str, Any]:
    """Return the parameters that stand in a name.

    Raises
    ------
    InputError
        If a word of it is not ``PARAMETER=VALUE``, a parameter stands there twice, or a value is
        not finite.
    """
    parameters: dict[str, Any] = {}
    for word in name.split()[1:]:
        key, _, value = word.partition("=")
        if not key or not value or key in parameters:
            form = "NAME PARAMETER=VALUE …, each parameter once"
            raise InputError(f"'{word}' in '{name}'; expected {form}", "--solver")
        parameters[key] = plain_value(value)
    return parameters


def name_with(solver: str, parameters: Mapping[str, Any]) -> str:
    """Return the name of a solver with parameters, from which `parameters_in` reads them again."""
    said = {k: v if isinstance(v, str) else json.dumps(v) for k, v in parameters.items()}
    return " ".join([solver, *(f"{key}={value}" for key, value in said.items())])


def parameters_of(name: str, given: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the parameters in a name, over those `given` under the solver's own name."""
    return {**given.get(solver_in(name), {}), **parameters_in(name)}


def plain_value(text: str) -> Any:
    """Return what a value says: a number or another value of JSON, else the text itself.

    Raises
    ------
    InputError
        If it is no finite number: records have no word for it.
    """
    for read in (json.loads, float):
        try:
            found = read(text)
        except ValueError:
            continue
        if isinstance(found, float) and not isfinite(found):
            raise InputError(f"'{text}' as a parameter; expected a finite value")
        return found
    return text
