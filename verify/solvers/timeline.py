"""One timeline for all that moves: outputs, openings, jumps of histories, and the steps between."""

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene, ToolPathCut
from verify.scene.physics import jumps

Array = NDArray[np.float64]

# A tool path opens a piece when the blade has passed all of it, and releases it at once; or as soon
# as the blade sweeps a cut in the support of a node of it, against forces that fade with the swept
# share (docs/theory/dynamics.md).
OPENINGS = ("late", "swept")

_ROUND_OFF = 1e-14  # of a time that steps have added up to
_CLOSE = 1e-9  # of the duration: times that close are one, steps added up are off by less


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

    outputs: Array
    opens: Array
    breaks: Array
    stops: Array
    close: float


def timeline_of(scene: Scene, kinks: bool) -> Timeline:
    """Return the timeline of a dynamic scene; with or without `kinks` of histories."""
    outputs = np.array(scene.analysis.output_times)
    end = float(outputs[-1])
    close = _CLOSE * end

    def snapped(times: Iterable[Any], to: Array) -> Array:
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
        ...

    @property
    def largest(self) -> float:
        """Largest time step of the body as it is open now, s."""
        ...

    def open(self, time: float) -> bool:
        """Open what the cuts have passed at a time, the state's up to steps added up.

        Returns
        -------
        bool
            Whether anything has opened.
        """
        ...

    def begin(self) -> None:
        """Take up what has jumped: at the start, at an opening or at a break."""
        ...

    def put_out(self) -> None:
        """Keep the state for the output, and enter it into the account."""
        ...

    def step(self, size: float) -> None:
        """Advance the state by a time, s, and account for it."""
        ...


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
        begun = mover.open(stop) or k == 0
        if begun:
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
