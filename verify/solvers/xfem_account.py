"""The energies and momenta of a motion at its output times, over all its stages."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.dynamics import DynamicBody, MotionState
from verify.xfem.dynamics.energy_ledger import EnergyLedger, Ledger

__all__ = ["Account"]

_STATE = ("kinetic", "strain", "gravity")
_DONE = {
    "load_work": "work_of_loads",
    "support_work": "work_of_supports",
    "damping": "damping",
    "algorithmic": "algorithmic",
    "unbalanced": "unbalanced",
}
_AXES = ("x", "y", "z")


class Account:
    """Rows of the ledgers of stages, one after the other; work goes on from stage to stage."""

    def __init__(self) -> None:
        self._rows: list[dict[str, float]] = []
        self._done = dict.fromkeys(_DONE.values(), 0.0)

    def enter(self, ledger: Ledger, instants: list[int]) -> None:
        """Enter the rows of a stage that are asked for, and keep what it has done in all."""
        for k in instants:
            row = {name: float(getattr(ledger, name)[k]) for name in _STATE}
            row |= {
                name: self._done[name] + float(getattr(ledger, column)[k])
                for column, name in _DONE.items()
            }
            row["total"] = (
                sum(row[name] for name in _STATE)
                - row["work_of_loads"]
                - row["work_of_supports"]
                + row["damping"]
                + row["algorithmic"]
            )
            row |= _components("linear_momentum", ledger.momentum[k])
            row |= _components("angular_momentum", ledger.angular_momentum[k])
            self._rows.append(row)
        for column, name in _DONE.items():
            self._done[name] += float(getattr(ledger, column)[-1])

    def open(
        self, body: DynamicBody, state: MotionState, further: DynamicBody, inherited: MotionState
    ) -> None:
        """Enter the energy that is lost where a body that is cut further takes over a state.

        Nothing without a sliver policy. It is the scheme's, like what a step dissipates.
        """
        before, after = (
            float(EnergyLedger(*of).close().mechanical[0])
            for of in ((body, state), (further, inherited))
        )
        self._done["algorithmic"] += before - after

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """All entries (t,) by name: energies in J, momenta in kg m/s and kg m²/s."""
        names = self._rows[0] if self._rows else {}
        return {name: np.array([row[name] for row in self._rows]) for name in names}


def _components(name: str, vector: NDArray[np.float64]) -> dict[str, float]:
    axes = ("z",) if len(vector) == 1 else _AXES[: len(vector)]
    return {f"{name}_{axis}": float(x) for axis, x in zip(axes, vector, strict=True)}
