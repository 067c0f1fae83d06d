"""The energies and momenta of a motion at its output times, over all its stages."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.energy_balance import BalanceRecorder, EnergyBalance

_STATE = ("kinetic", "strain", "gravity")
_DONE = {
    "load_work": "work_of_loads",
    "support_work": "work_of_supports",
    "damping": "damping",
    "algorithmic": "algorithmic",
    "unbalanced": "unbalanced",
}
_REMOVED = ("removed_energy", "removed_mass")
_AXES = ("x", "y", "z")


class Account:
    """Rows of the ledgers of stages, one after the other; work goes on from stage to stage.

    Parameters
    ----------
    removal : bool
        Whether openings take material away: its energy and mass have entries of their own.
    """

    def __init__(self, removal: bool = False) -> None:
        self._rows: list[dict[str, float]] = []
        self._done = dict.fromkeys(_DONE.values(), 0.0)
        self._removed = dict.fromkeys(_REMOVED if removal else (), 0.0)

    def enter(self, ledger: EnergyBalance, instants: list[int]) -> None:
        """Enter the rows of a stage that are asked for, and keep what it has done in all."""
        for k in instants:
            row = {name: float(getattr(ledger, name)[k]) for name in _STATE}
            row |= {
                name: self._done[name] + float(getattr(ledger, column)[k])
                for column, name in _DONE.items()
            }
            row |= self._removed
            row["penalty"] = float(ledger.penalty[k])
            row["total"] = (
                sum(row[name] for name in _STATE)
                - row["work_of_loads"]
                - row["work_of_supports"]
                + row["damping"]
                + row["algorithmic"]
                + row.get("removed_energy", 0.0)
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

        Nothing without a sliver policy and with masses of one part each; what EVS and GEVS gain or
        lose is the scheme's, like what a step dissipates.
        What is removed takes its energy and its mass with it.
        """
        before, after = (
            float(BalanceRecorder(*of).close().mechanical[0])
            for of in ((body, state), (further, inherited))
        )
        if self._removed:
            self._removed["removed_energy"] += before - after
            self._removed["removed_mass"] += float(
                body.mass.weights.sum() - further.mass.weights.sum()
            )
        else:
            self._done["algorithmic"] += before - after

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """All entries (t,) by name: energies in J, momenta in kg m/s and kg m²/s.

        The share of a ghost penalty in the strain energy is among them if there is one.
        """
        names = self._rows[0] if self._rows else {}
        found = {name: np.array([row[name] for row in self._rows]) for name in names}
        return {name: row for name, row in found.items() if name != "penalty" or row.any()}


def _components(name: str, vector: NDArray[np.float64]) -> dict[str, float]:
    axes = ("z",) if len(vector) == 1 else _AXES[: len(vector)]
    return {f"{name}_{axis}": float(x) for axis, x in zip(axes, vector, strict=True)}
