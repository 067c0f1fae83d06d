"""Statements of a solver about scenes before it solves: ``python -m verify.runner.survey FILE``.

In a process of its own, because to ask a solver means to import it, and some start MPI.
"""

import inspect
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from verify.errors import InputError, UnsupportedSceneError
from verify.json_files import read_json, write_json
from verify.printable import one_line, words_of
from verify.processes import die_with_parent
from verify.runner.fingerprint import digest_of, file_digest
from verify.whole_files import write_whole

ANSWER, ASKING = "answer.json", "asking"  # files by which it says where it is
_NONE: Mapping[str, Any] = MappingProxyType({})


def main(question: Path) -> None:
    """Answer the `question` in the file ``answer.json`` beside it.

    Before each case its number goes into the file ``asking``: if no answer comes, that is the
    case at which the solver hangs or dies.
    """
    die_with_parent()
    question = question.resolve()  # a solver may change the working directory
    asked = read_json(question)
    answers = survey(
        asked["solver"],
        asked["scenes"],
        asked["parameters"],
        lambda number: write_whole(question.with_name(ASKING), str(number)),
    )
    write_json(answers, question.with_name(ANSWER))


def survey(
    name: str,
    scenes: list[dict[str, Any]],
    parameters: Mapping[str, Any] = _NONE,
    asking: Callable[[int], None] = lambda number: None,
) -> dict[str, Any]:
    """Ask the solver `name` about `scenes` and `parameters`.

    Parameters
    ----------
    name : str
    scenes : list of dict
        As `verify.scene.scene_content` gives them.
    parameters : mapping of str
    asking : callable
        Is told the number of each scene before the solver is asked about it.

    Returns
    -------
    dict
        ``error`` (why there is no such solver here), ``bad_parameter`` (which it does not have),
        or ``source`` (hash of the file that defines it) and ``cases``: by name ``levels``,
        ``refusal``, ``bad_input`` (of the case) and ``failure`` (of the solver).
    """
    from verify.solvers import check_parameters, find_solver
    from verify.solvers.named import solver_in

    if ":" in name:
        sys.path.append(os.getcwd())
    try:
        solver = find_solver(solver_in(name))
    except InputError as error:
        return {"error": str(error)}
    try:
        check_parameters(solver_in(name), solver, parameters)
    except InputError as error:
        return {"error": None, "bad_parameter": str(error)}
    cases: dict[str, Any] = {}
    for number, content in enumerate(scenes):
        asking(number)
        cases[content["name"]] = _answer(name, solver, content)
    return {"error": None, "source": _source(solver), "cases": cases}


def _answer(name: str, solver: Any, content: dict[str, Any]) -> dict[str, Any]:
    from verify.scene import restore_scene
    from verify.solvers.interface import checked_levels, checked_refusal, is_built_in

    answer: dict[str, Any] = dict.fromkeys(("refusal", "bad_input", "failure")) | {"levels": 0}
    try:
        scene = restore_scene(content)
        answer["refusal"] = checked_refusal(solver.refuses(scene))
        if not answer["refusal"]:
            answer["levels"] = checked_levels(solver.levels(scene))
    except InputError as error:  # of a guest we do not know whose fault it is
        answer["bad_input" if is_built_in(name) else "failure"] = one_line(error)
    except UnsupportedSceneError as error:
        answer["refusal"] = one_line(error)
    except BaseException as error:  # a solver may raise anything
        traceback.print_exc()
        answer["failure"] = words_of(error)
    return answer


def _source(solver: Any) -> str:
    """Digest of the file that defines it, and of those that it says its answers depend on."""
    try:
        source = inspect.getsourcefile(type(solver))
        files = [Path(source)] if source else []
        digests = [file_digest(path) for path in [*files, *getattr(solver, "files", ())]]
        return digests[0] if len(digests) == 1 else digest_of(digests) if digests else ""
    except (OSError, TypeError):  # of no file, or of one that is not there
        return ""


if __name__ == "__main__":
    main(Path(sys.argv[1]))
