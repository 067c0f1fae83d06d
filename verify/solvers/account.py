"""Account of a motion: energies and momenta at its output times, by name."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_AXES = ("x", "y", "z")


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
        removed: Mapping[str, float] | None = None,
    ) -> None:
        """Enter a row.

        Parameters
        ----------
        state : mapping
            Energies of the state by name, J.
        done : mapping
            What was done since the start, J: by the names of `reference.dynamics_ledger.DONE`.
        momentum, angular_momentum : (d,), (1 or 3,) array
            In kg m/s and kg m²/s.
        removed : mapping, optional
            ``removed_energy`` and ``removed_mass``, where openings take material away.
        """
        row = {**state, **done, **(removed or {})}
        total = sum(state.values()) - done["work_of_loads"] - done["work_of_supports"]
        row["total"] = total + done["damping"] + done["algorithmic"]
        row["total"] += row.get("removed_energy", 0.0)
        vectors = {"linear_momentum": momentum, "angular_momentum": angular_momentum}
        for name, vector in vectors.items():
            axes = ("z",) if len(vector) == 1 else _AXES[: len(vector)]
            row |= {f"{name}_{axis}": float(x) for axis, x in zip(axes, vector, strict=True)}
        self._rows.append(row)

    def columns(self) -> dict[str, _Floats]:
        """All entries (t,) by name."""
        names = self._rows[0] if self._rows else {}
        return {name: np.array([row[name] for row in self._rows]) for name in names}
