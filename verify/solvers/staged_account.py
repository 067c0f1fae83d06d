"""Account of a motion of the compact solvers, over the stages between openings."""

import numpy as np
from numpy.typing import NDArray

from verify.solvers.account import Account
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.energy_balance import BalanceRecorder, EnergyBalance

_Floats = NDArray[np.float64]
_DONE = {
    "load_work": "work_of_loads",
    "support_work": "work_of_supports",
    "damping": "damping",
    "algorithmic": "algorithmic",
    "unbalanced": "unbalanced",
    "cut_work": "cut_work",
}


class StagedAccount(Account):
    """Account over the stages between openings; work goes on from stage to stage.

    Parameters
    ----------
    removal : bool
        Whether openings take material away: its energy and mass have entries of their own.
    """

    def __init__(self, removal: bool = False) -> None:
        super().__init__()
        self._done = dict.fromkeys(_DONE.values(), 0.0)
        self._turned: float | _Floats = 0.0  # angular impulse of tie forces, N m s
        self._projection = 0.0
        self._removed = dict.fromkeys(("removed_energy", "removed_mass") if removal else (), 0.0)
        self._penalty: list[float] = []

    def leave(self, ledger: EnergyBalance, instants: list[int]) -> None:
        """Enter the rows of a stage that are asked for, and keep what it has done in all."""

        def done(k: int) -> dict[str, float]:
            found = {
                name: self._done[name] + float(getattr(ledger, column)[k])
                for column, name in _DONE.items()
            }
            return {**found, "projection": self._projection}

        for k in instants:
            state = {n: float(getattr(ledger, n)[k]) for n in ("kinetic", "strain", "gravity")}
            momenta = ledger.momentum[k], ledger.angular_momentum[k]
            self.enter(state, done(k), *momenta, self._turned + ledger.cut_turn[k], self._removed)
            self._penalty.append(float(ledger.penalty[k]))
        self._done, self._turned = done(-1), self._turned + ledger.cut_turn[-1]

    def open(
        self, body: DynamicBody, state: MotionState, further: DynamicBody, inherited: MotionState
    ) -> None:
        """Enter the energy that is lost where a body that is cut further takes over a state.

        Nothing without a sliver policy and with masses of one part each. What a policy loses by
        its projection has an entry of its own, and what EVS and GEVS gain or lose with it.
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
            self._projection += before - after

    def columns(self) -> dict[str, _Floats]:
        """All entries (t,) by name; with the share of a ghost penalty in the strain energy."""
        penalty = {"penalty": np.array(self._penalty)} if any(self._penalty) else {}
        return super().columns() | penalty
