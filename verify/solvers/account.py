"""Account of a motion: energies and momenta at its output times, by name."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_AXES = ("x", "y", "z")
# entries that only some motions have: left out where they stay zero
_OF_SOME = ("cut_work", "projection", "cut_angular_impulse")
_TAKEN = ("damping", "algorithmic", "cut_work", "projection", "removed_energy")


class Account:
    """A row for every output, of whatever has moved."""

    def __init__(self) -> None:
        self._rows: list[dict[str, float]] = []

    def enter(
        self,
        state: Mapping[str, float],
        done: Mapping[str, float],
        momentum: _Floats,
        angular_momentum: _Floats,
        cut_angular_impulse: _Floats,
        removed: Mapping[str, float] | None = None,
    ) -> None:
        """Enter a row.

        Parameters
        ----------
        state : mapping
            Energies of the state by name, J.
        done : mapping
            What was done since the start, J: by the names of `reference.dynamics_step.DONE`.
        momentum, angular_momentum : (d,), (1 or 3,) array
            In kg m/s and kg m²/s.
        cut_angular_impulse : (1 or 3,) array
            Of the tie forces of what the cuts have released, since the start, N m s.
        removed : mapping, optional
            ``removed_energy`` and ``removed_mass``, where openings take material away.
        """
        row = {**state, **done, **(removed or {})}
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
        """All entries (t,) by name."""
        names = self._rows[0] if self._rows else {}
        columns = {name: np.array([row[name] for row in self._rows]) for name in names}
        return {n: one for n, one in columns.items() if one.any() or not n.startswith(_OF_SOME)}
