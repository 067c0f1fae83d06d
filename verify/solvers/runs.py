"""Run of any own solver: its record, the timeline of what moves, its march and ledger.

And the cells that a scene asks for, with those that an interface crosses.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import inf
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.simplices import measures
from verify.scene import Box, Rectangle, Scene, ToolPathCut, crossed_by_interfaces
from verify.scene.physics import CLOSE, jumps
from verify.solution import Regularisation, Solution

_Floats = NDArray[np.float64]


@dataclass
class Record:
    """What a run says of itself beside its fields, filled as it goes: entries of `Solution`.

    Attributes
    ----------
    timings : dict of str to float
        Wall seconds of each phase.
    iterations : dict of str to int
    regularisations : list of Regularisation
        Entries with a count of 0 are left out.
    notes : dict of str to str
    """

    timings: dict[str, float] = field(default_factory=dict)
    iterations: dict[str, int] = field(default_factory=dict)
    regularisations: list[Regularisation] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)

    @contextmanager
    def timed(self, phase: str) -> Iterator[None]:
        """Add the time of a ``with`` block to a phase."""
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
            regularisations=[one for one in self.regularisations if one.count],
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


# A tool path opens a piece when the blade has passed all of it, and releases it at once; or as soon
# as the blade sweeps a cut in the support of a node of it, against forces that fade with the swept
# share (docs/theory/dynamics.md).
OPENINGS = {
    "late": "elements as a whole, when the blade has crossed them through",
    "swept": "elements ahead of the blade, held by forces that fade with what it has swept",
}

_ROUND_OFF = 1e-14  # of a time that steps have added up to


@dataclass(frozen=True)
class Timeline:
    """When something happens in a dynamic scene, s; times that are close are one.

    Attributes
    ----------
    outputs : (t,) array
        Ascending; the last is the end.
    opens : (c,) array
        When each cut of the scene opens as a whole; of a tool path, when its blade sets out.
    breaks : (b,) array
        When a load or support jumps, or where asked for has a kink.
    stops : (s,) array
        Times at which a step has to end, from 0 to the end: outputs, breaks, and whole cuts.
    close : float
        Times that differ by no more are one.
    """

    outputs: _Floats
    opens: _Floats
    breaks: _Floats
    stops: _Floats
    close: float


def timeline_of(scene: Scene, kinks: bool) -> Timeline:
    """Return the timeline of a dynamic scene; with or without `kinks` of histories."""
    outputs = np.array(scene.analysis.output_times)
    end = float(outputs[-1])
    close = CLOSE * end

    def snapped(times: Iterable[Any], to: _Floats) -> _Floats:
        given = np.array(list(times), dtype=float)
        nearest = to[np.abs(to[:, None] - given).argmin(axis=0)]
        return np.where(np.abs(nearest - given) <= close, nearest, given)

    opens = snapped((getattr(cut, "opens_at", 0.0) for cut in scene.cuts), outputs)
    whole = opens[[not isinstance(cut, ToolPathCut) for cut in scene.cuts]]
    tables = [getattr(part, "history", None) or () for part in (*scene.supports, *scene.loads)]
    found = [t for table in tables for t in ([t for t, _ in table] if kinks else jumps(table))]
    breaks = snapped(found, np.concatenate([outputs, whole]))
    stops = np.unique([0.0, *outputs, *whole, *breaks])
    return Timeline(outputs, opens, breaks, stops[stops <= end], close)


class Mover(Protocol):
    """A body in motion and its state: what every solver offers the march."""

    @property
    def time(self) -> float:
        """Time of the state, s."""

    @property
    def largest(self) -> float:
        """Largest time step of the body as it is open now, s."""

    def open(self, time: float) -> bool:
        """Open what the cuts have passed at a time, the state's up to steps added up.

        Returns
        -------
        bool
            Whether anything has opened.
        """

    def begin(self) -> None:
        """Take up what has jumped: at the start, at an opening or at a break."""

    def put_out(self) -> None:
        """Keep the state for the output, and enter it into the account."""

    def step(self, size: float) -> None:
        """Advance the state by a time, s, and account for it."""


def march(
    timeline: Timeline, mover: Mover, halvings: int = 0, trial: bool = False
) -> Counter[float]:
    """Step from stop to stop by equal steps, and open on the way what the cuts have passed.

    Parameters
    ----------
    timeline : Timeline
    mover : Mover
        At the time 0, before what opens then.
    halvings : int
        How often every step is halved that would be taken. The largest step is not: where stops
        cut it short that would change nothing.
    trial : bool
        Whether to stop after the first step: what compiles, compiles in it.

    Returns
    -------
    Counter
        How many steps of each size were taken, s.
    """
    sizes: Counter[float] = Counter()
    stops = timeline.stops.tolist()
    for k, stop in enumerate(stops):
        if begun := mover.open(stop) or k == 0:
            mover.begin()
        if stop in timeline.outputs:
            mover.put_out()
        if k == len(stops) - 1:
            break
        if not begun and stop in timeline.breaks:
            mover.begin()
        _step_between(stop, stops[k + 1], mover, halvings, sizes, trial)
        if trial:
            break
    return sizes


def _step_between(
    start: float, stop: float, mover: Mover, halvings: int, sizes: Counter[float], trial: bool
) -> None:
    """Step between two stops; count the steps anew where an opening has changed the largest one."""
    left, size, largest = 0, 0.0, np.nan
    while True:
        if mover.largest != largest:
            # at first from the stop itself: the state's time has the round-off of added steps
            span, largest = stop - (mover.time if size else start), mover.largest
            left = max(1, int(np.ceil(span / largest * (1 - 1e-9)))) * 2**halvings
            size = span / left
            # the same up to the round-off of times: one integrator
            known = min(sizes, key=lambda one: abs(one - size), default=size)
            size = known if abs(known - size) * left <= _ROUND_OFF * stop else size
        mover.step(size)
        sizes[size] += 1
        left -= 1
        if trial or not left:
            return
        if mover.open(mover.time):
            mover.begin()


def notes_of_steps(
    scene: Scene, sizes: Collection[float], scheme: str, mass: str, element: float
) -> dict[str, str]:
    """Say by what steps a motion was integrated: scheme, mass, smallest and largest step.

    And how far the fastest blade goes in the longest step, in elements (m). More than half of one
    is late by that much, whatever the rule.
    """
    ends = (min(sizes), max(sizes)) if sizes else ()
    steps = " … ".join(dict.fromkeys(f"{size:.6g} s" for size in ends)) or "none"
    notes = {"scheme": scheme, "mass": mass, "time step": steps}
    speeds = [cut.top_speed for cut in scene.cuts if isinstance(cut, ToolPathCut)]
    if speeds and sizes:
        share = max(speeds) * max(sizes) / element
        late = "; more than half of one: openings are late" if share > 0.5 * (1 + 1e-9) else ""
        notes["blade advance in a step"] = f"{share:.2g} of an element{late}"
    return notes


_AXES = ("x", "y", "z")
# entries that only some motions have: left out where they stay zero
_OF_SOME = ("cut_work", "projection", "cut_angular_impulse")
_TAKEN = ("damping", "algorithmic", "cut_work", "projection", "removed_energy")


def pressure_at_end(steps: Sequence[_Floats], lag: float) -> _Floats:
    """Compute a pressure of contact at the end of a step from the last steps, Pa.

    The pressure of a step belongs to the time at which it balances forces. Undamped, pressures
    alternate from step to step about their mean.

    Parameters
    ----------
    steps : three arrays
        The last first; nan before faces were free.
    lag : float
        Share of the step between that time and its end.
    """
    known = np.array(steps)
    whole = 0.5 * (known[0] + known[1]) + (0.25 + 0.5 * lag) * (known[0] - known[2])
    count = np.isfinite(known).sum(axis=0)
    mean = np.nansum(known, axis=0) / np.maximum(count, 1)
    return np.maximum(np.where(count == 3, whole, mean), 0.0)


def work_of_blades(cuts: Sequence[Any], by_cut: _Floats | float) -> dict[str, float]:
    """Name the energy that each of several blades has taken, J, from all cuts' (cuts,)."""
    blades = [cut.on_the_way for cut in cuts]
    taken = zip(cuts, blades, np.zeros(len(cuts)) + by_cut, strict=True)
    found = {f"cut_work_{cut.name}": float(work) for cut, blade, work in taken if blade}
    return found if len(found) > 1 else {}


class LedgerRows:
    """Rows of the ledger, one for every output, of whatever has moved."""

    def __init__(self) -> None:
        self._rows: list[dict[str, float]] = []

    def enter(
        self,
        state: Mapping[str, float],
        done: Mapping[str, float],
        momentum: _Floats,
        angular_momentum: _Floats,
        cut_angular_impulse: _Floats,
    ) -> None:
        """Enter a row.

        Parameters
        ----------
        state : mapping
            Energies of the state by name, J.
        done : mapping
            What was done since the start, J: by the names of `reference.dynamics_step.DONE`; and
            `work_of_blades`; and ``removed_energy`` and ``removed_mass``, where openings take
            material away.
        momentum, angular_momentum : (d,), (1 or 3,) array
            In kg m/s and kg m²/s.
        cut_angular_impulse : (1 or 3,) array
            Of the tie forces of what the cuts have released, since the start, N m s.
        """
        row = {**state, **done}
        total = sum(state.values()) - done["work_of_loads"] - done["work_of_supports"]
        row["total"] = total + sum(row.get(name, 0.0) for name in _TAKEN)
        vectors = {
            "linear_momentum": momentum,
            "angular_momentum": angular_momentum,
            "cut_angular_impulse": cut_angular_impulse,
        }
        for name, vector in vectors.items():
            axes = ("z",) if len(vector) == 1 else _AXES[: len(vector)]
            row |= {f"{name}_{axis}": float(x) for axis, x in zip(axes, vector, strict=True)}
        self._rows.append(row)

    def columns(self) -> dict[str, _Floats]:
        """Return all entries (t,) by name."""
        names = self._rows[0] if self._rows else {}
        columns = {name: np.array([row[name] for row in self._rows]) for name in names}
        return {n: one for n, one in columns.items() if one.any() or not n.startswith(_OF_SOME)}


def grid_of(scene: Scene, level: int) -> tuple[list[int] | None, float]:
    """Find cells along each axis, None if unstructured, and element size h in m, of a level.

    Of a mesh that the scene does not give itself, but its pattern and sizes or numbers of cells.
    """
    geometry, asked = scene.geometry, scene.mesh
    if asked.pattern == "unstructured" or not isinstance(geometry, Rectangle | Box):
        assert asked.sizes is not None
        return None, asked.sizes[level]
    counts = asked.divisions(geometry, level)
    sides = np.subtract(geometry.upper, geometry.lower)
    return counts.tolist(), float((sides / counts).max())


def across_interfaces(
    scene: Scene, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> list[Regularisation]:
    """State the cells (m, k + 1) that an interface crosses: of the material at their centroid."""
    if scene.material.is_uniform:
        return []
    crossed = crossed_by_interfaces(scene.material, points, cells)
    sizes = measures(points[cells])
    share = float(sizes[crossed].sum() / sizes.sum())
    kind = "cell across an interface, of the material at its centroid"
    return [Regularisation(kind, int(crossed.sum()), share, "volume fraction of the body")]
