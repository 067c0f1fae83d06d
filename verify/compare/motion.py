"""Fields over time: of a solution between its output times, exact, or constant in time.

Between two output times a solution is linear in time: nothing else is known of it.
"""

from collections.abc import Callable
from copy import copy
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.cut_deviation import RealisedCut
from verify.compare.locate import Field, SolutionField
from verify.compare.realised import field_of
from verify.errors import InputError, UnsupportedSceneError
from verify.solution import Solution

Array = NDArray[np.float64]


_Found = dict[tuple[int, int], tuple[Array, Array | None, NDArray[np.int64]]]


class Sampled:
    """A field with its values kept per array of points (by identity; arrays must not change).

    Parameters
    ----------
    field : Field
    found : dict, optional
        Cells of arrays of points, if it is a solution's: kept for all of its output times.
    """

    def __init__(self, field: Field, found: _Found | None = None) -> None:
        self._field, self._found = field, {} if found is None else found
        self._kept: dict[tuple[int, int, str], tuple[Array, Array | None, Array]] = {}

    @property
    def size(self) -> int:
        """Bytes of the values that are kept."""
        return sum(values.nbytes for *_, values in self._kept.values())

    def cells(self, points: Array, near: Array | None = None) -> NDArray[np.int64]:
        """Find cells (n,) of a solution that hold `points` (n, d), on the side of `near`."""
        assert isinstance(self._field, SolutionField)
        key = id(points), id(near)
        if key not in self._found:  # holds the arrays, so that their ids stay theirs
            self._found[key] = points, near, self._field.cells_at(points, near)
        return self._found[key][2]

    def _at(self, what: str, points: Array, near: Array | None) -> Array:
        key = id(points), id(near)
        if (*key, what) not in self._kept:
            if isinstance(self._field, SolutionField):
                both = self._field.in_cells(points, self.cells(points, near))
                found = dict(zip(("displacement", "gradient"), both, strict=True))
            else:  # a formula: only the one quantity
                found = {what: getattr(self._field, what)(points, near)}
            for name, values in found.items():  # holds the arrays, so ids stay theirs
                self._kept[(*key, name)] = points, near, values
        return self._kept[(*key, what)][2]

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d) in m at `points` (n, d)."""
        return self._at("displacement", points, near)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d) at `points` (n, d)."""
        return self._at("gradient", points, near)


_SAME_TIME = 1e-9  # of the duration: two output times this close are one
# Bytes of values of a reference over the times of one level: kept, they are evaluated once for all
# solvers; beyond, the newest time gives way to the next.
_ROOM = 3 * 10**8


class _Times:
    """Fields at times, with what each remembers of points."""

    def __init__(self, room: int = 0) -> None:
        self._room, self._fields = room, dict[float | None, Sampled]()

    def at(self, time: float | None, make: Callable[[], Sampled]) -> Sampled:
        if time not in self._fields:
            if sum(field.size for field in self._fields.values()) >= self._room and self._fields:
                self._fields.popitem()
            self._fields[time] = make()
        return self._fields[time]


class Motion(Protocol):
    """A displacement field over time."""

    def at(self, time: float | None = None) -> Field:
        """Compute the field at a time in s; None is the last."""
        ...

    def known_at(self, time: float) -> bool:
        """Tell whether the field is known at that time, not interpolated."""
        ...

    def afresh(self) -> "Motion":
        """Return the same motion, which forgets what was asked and remembers what will be."""
        ...


def step_at(solution: Solution, time: float | None) -> int:
    """Give the number of the output time that is `time`, s; None is the last.

    Raises
    ------
    UnsupportedSceneError
        If the solution has none there.
    """
    if time is None:
        return len(solution.times) - 1
    step = int(np.argmin(np.abs(solution.times - time)))
    if abs(solution.times[step] - time) > _SAME_TIME * float(np.ptp(solution.times)):
        raise UnsupportedSceneError(f"the solution has no field at {time:.6g} s")
    return step


class SolutionMotion:
    """The field of a solution over time; the cells of an array of points are found once.

    Parameters
    ----------
    solution : Solution
    body : Body or SolidBody
        Its cuts as asked say where the sides are.
    deviation, continued
        See `verify.compare.realised.field_of`.
    """

    def __init__(
        self,
        solution: Solution,
        body: AnyBody,
        deviation: float = 0.0,
        continued: bool | RealisedCut = True,
    ) -> None:
        self.solution = solution
        self._field = field_of(solution, body, deviation=deviation, continued=continued)
        self._found: _Found = {}
        self._times = _Times()

    @property
    def off_surface(self) -> float:
        """Distance of a membrane's solution from the surface of its body, m; 0 of other bodies."""
        return getattr(self._field, "off_surface", 0.0)

    def afresh(self) -> "SolutionMotion":
        """Return the same motion, which forgets what was asked and remembers what will be."""
        other = copy(self)
        other._found, other._times = {}, _Times(_ROOM)
        return other

    def known_at(self, time: float) -> bool:
        """Tell whether `time` is an output time."""
        times = self.solution.times
        close: bool = bool(np.abs(times - time).min() <= _SAME_TIME * max(np.ptp(times), 1e-300))
        return close

    def cells_at(self, points: Array, near: Array) -> NDArray[np.int64]:
        """Find the cell (n,) that holds each of `points` (n, d), on the side of `near`."""
        return self._field.cells_at(points, near)

    def differs(self, other: "SolutionMotion", points: Array) -> NDArray[np.bool_]:
        """Tell whether another motion of the same solution is of another cell at points (n, d)."""
        own, others = (Sampled(m._field, m._found).cells(points, points) for m in (self, other))
        return np.asarray(own != others)

    def at(self, time: float | None = None) -> Field:
        """Compute the field at a time in s; None is the last.

        Raises
        ------
        InputError
            If the solution does not reach that time.
        """
        times = self.solution.times
        when = float(times[-1] if time is None else time)
        return self._times.at(
            when, lambda: Sampled(self._field.with_nodal(self.nodal(when)), self._found)
        )

    def nodal(self, time: float | None = None) -> Array:
        """Compute nodal displacements (n, d) in m at a time in s; None is the last.

        Raises
        ------
        InputError
            If the solution does not reach that time.
        """
        times, u = self.solution.times, self.solution.displacement
        time = float(times[-1] if time is None else time)
        slack = _SAME_TIME * float(np.ptp(times))
        if not times[0] - slack <= time <= times[-1] + slack:
            raise InputError(
                f"a field at {time:.6g} s was asked for; the solution's output times are from "
                f"{times[0]:.6g} to {times[-1]:.6g} s"
            )
        nearest = int(np.argmin(np.abs(times - time)))
        if abs(times[nearest] - time) <= slack:
            return u[nearest]
        after = int(np.searchsorted(times, time))
        share = (time - times[after - 1]) / (times[after] - times[after - 1])
        between: Array = (1 - share) * u[after - 1] + share * u[after]
        return between


class ExactMotion:
    """An exact field, over time if it offers ``at(time)``; else it stands still.

    Parameters
    ----------
    exact : object with ``displacement`` and ``gradient``, perhaps ``at``
    end : float, optional
        The last time, s; None where it stands still.
    """

    def __init__(self, exact: Any, end: float | None = None) -> None:
        self._exact, self._end = exact, end
        self._times = _Times()

    def afresh(self) -> "ExactMotion":
        """Return the same motion, which forgets what was asked and remembers what will be."""
        other = copy(self)
        other._times = _Times(_ROOM)
        return other

    def known_at(self, time: float) -> bool:
        """Tell whether the field is known: always."""
        return True

    def at(self, time: float | None = None) -> Field:
        """Return the field at a time in s; None is its last or only one."""
        time = self._end if time is None else time
        return self._times.at(time, lambda: Sampled(field_at(self._exact, time)))


def field_at(exact: Any, time: float | None) -> Any:
    """Return an exact field at a time, s: itself where there is no time or it stands still."""
    return exact.at(time) if time is not None and hasattr(exact, "at") else exact
