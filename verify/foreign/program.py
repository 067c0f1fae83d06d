"""A foreign solver as a solver of the framework: its program, run by its own Python."""

import os

from verify.errors import InputError
from verify.exchange.program import ProgramSolver
from verify.foreign.installing import mark_of, state_of
from verify.foreign.records import PROGRAMS, foreign_solver
from verify.scene import Scene


class ForeignProgram(ProgramSolver):
    """The foreign solver `name`.

    Attributes
    ----------
    files : list of path
        What its answers depend on, for the fingerprint of a solve.
    implicit : bool
        No step of any of these programs is critical: no study looks for one by running them.

    Raises
    ------
    InputError
        If there is no such solver, or it is not installed.
    """

    repeats = True
    implicit = True

    def __init__(self, name: str) -> None:
        record = foreign_solver(name)
        state = state_of(record)
        if not state.python:
            raise InputError(f"solver '{name}' is not installed: {state.missing}")
        program = record.folder / "program.py"
        self.name, self.conforming = name, record.conforming
        self.parameters, self.choices = record.parameters, record.choices
        self._takes = record.takes
        # without the user's packages and paths, which belong to another Python
        self.command = (state.python, "-s", str(program), "{folder}", "{level}")
        self.files = [*record.folder.glob("*.*"), *PROGRAMS.glob("*.py"), mark_of(name)]
        self.files = [file for file in self.files if file.is_file()]

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what its record does not list."""
        return self._takes.refusal(scene)

    def environment(self) -> dict[str, str]:
        """Return that of this process, with the reader and writer as the only path."""
        inherited = {key: value for key, value in os.environ.items() if key != "PYTHONHOME"}
        return {**inherited, "PYTHONPATH": str(PROGRAMS), "PYTHONDONTWRITEBYTECODE": "1"}
