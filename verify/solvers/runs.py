"""Runs of our solvers: what a run says of itself, repeated and timed."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import inf
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.solution import Regularisation, Solution


@dataclass
class Record:
    """What a run says of itself beside its fields, filled as it goes: entries of `Solution`.

    Attributes
    ----------
    timings : dict of str to float
        Wall seconds of each phase.
    iterations : dict of str to int
    regularisations : list of Regularisation
    notes : dict of str to str
    """

    timings: dict[str, float] = field(default_factory=dict)
    iterations: dict[str, int] = field(default_factory=dict)
    regularisations: list[Regularisation] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)

    @contextmanager
    def timed(self, phase: str) -> Iterator[None]:
        """Add the time of what is done in a ``with`` to that of a phase."""
        start = perf_counter()
        try:
            yield
        finally:
            self.timings[phase] = self.timings.get(phase, 0.0) + perf_counter() - start

    def solution(self, **fields: Any) -> Solution:
        """Return the solution with these `fields` of it, and all that is recorded."""
        return Solution(
            **fields,
            timings={phase: [seconds] for phase, seconds in self.timings.items()},
            iterations=self.iterations,
            regularisations=self.regularisations,
            notes=self.notes,
        )


def at_rest(displacement: NDArray[np.float64], strain_energy: float) -> dict[str, Any]:
    """Return the fields of `Solution` of an equilibrium: displacement (N, d) in m, energy in J."""
    return {
        "displacement": displacement[None],
        "ledger": {"strain": np.array([strain_energy])},
        "unknowns": displacement.size,
    }


def check_steps(load_steps: int, step_factor: float) -> None:
    """Raise `InputError` unless load steps are counted from 0 and a factor of steps is positive."""
    whole = isinstance(load_steps, int) and load_steps >= 0
    if not whole or not isinstance(step_factor, int | float) or not 0.0 < step_factor < inf:
        text = f"load_steps {load_steps}, step_factor {step_factor}"
        raise InputError(f"{text}; expected at least 0, and a positive number")


def repeated[Mesh](
    repetitions: int,
    make_mesh: Callable[[], Mesh],
    run: Callable[[Mesh, bool], Solution],
    trial_mesh: Callable[[], Mesh] | None = None,
) -> Solution:
    """Run as often as asked for, and at least once, on a mesh that is made anew for each run.

    Parameters
    ----------
    repetitions : int
        Without any nothing is timed.
    make_mesh : callable
    run : callable
        Solves on a mesh; says whether it is a trial, which compiles what compiles and is not timed.
    trial_mesh : callable, optional
        Makes the mesh of the trial; default: the same.

    Returns
    -------
    Solution
        Of the last run, with the timings of all.
    """
    timings: dict[str, list[float]] = {}
    if repetitions:
        run((trial_mesh or make_mesh)(), True)
    for _ in range(max(1, repetitions)):
        start = perf_counter()
        mesh = make_mesh()
        meshing = perf_counter() - start
        found = run(mesh, False)
        for phase, seconds in {"meshing": [meshing], **found.timings}.items():
            timings.setdefault(phase, []).extend(seconds)
    return replace(found, timings=timings if repetitions else {})
