"""What a solver says about scenes before it solves: ``python -m verify.runner.survey FILE``.

In a process of its own, because to ask a solver means to import it, and some start MPI.
"""

import inspect
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.runner.childhood import die_with_parent
from verify.runner.fingerprint import file_digest

__all__ = ["main", "survey"]


def main(question: Path) -> None:
    """Answer the `question` in the file ``answer.json`` beside it."""
    die_with_parent()
    asked = read_json(question)
    write_json(
        survey(asked["solver"], asked["scenes"], asked["parameters"]),
        question.parent / "answer.json",
    )


def survey(
    name: str, scenes: list[dict[str, Any]], parameters: Sequence[str] = ()
) -> dict[str, Any]:
    """Ask the solver `name` about `scenes` and the names of `parameters`.

    Returns
    -------
    dict
        ``error`` (why there is no such solver here), ``bad_parameter`` (which it does not have),
        or ``source`` (hash of the file that defines it) and ``cases``: by name ``levels``,
        ``refusal`` and ``bad_input``.
    """
    from verify.scene import restore_scene
    from verify.solvers import check_parameters, find_solver

    if ":" in name:
        sys.path.append(os.getcwd())
    try:
        solver = find_solver(name)
    except InputError as error:
        return {"error": str(error)}
    try:
        check_parameters(name, solver, parameters)
    except InputError as error:
        return {"error": None, "bad_parameter": str(error)}
    cases: dict[str, Any] = {}
    for content in scenes:
        answer: dict[str, Any] = {"levels": 0, "refusal": None, "bad_input": None}
        try:
            scene = restore_scene(content)
            answer["refusal"] = solver.refuses(scene)
            if not answer["refusal"]:
                answer["levels"] = solver.levels(scene)
        except InputError as error:
            answer["bad_input"] = str(error)
        cases[content["name"]] = answer
    source = inspect.getsourcefile(type(solver))
    return {"error": None, "source": file_digest(Path(source)) if source else "", "cases": cases}


if __name__ == "__main__":
    main(Path(sys.argv[1]))
