"""Energy balance of a motion, step by step, for every scheme.

A step balances M a_α + f_visc + f_int − f_ext = r with the reactions r. Multiplied by Δu this is
an identity, whatever scheme chose the forces:

    ΔT + ΔW − Δu·f_ext − Δu·r + Δu·f_visc + D = 0,   D = (Δu·M a_α − ΔT) + (Δu·f_int − ΔW).

D is what the scheme itself dissipates (negative: produces). What the step leaves unsolved at
free unknowns is kept apart: if it is not round-off, the sum of all is not constant.
"""

import numpy as np
from numpy.typing import NDArray

from reference.dynamics_body import MovingBody
from reference.dynamics_step import State, StepForces

Array = NDArray[np.float64]
_DONE = ("work_of_loads", "work_of_supports", "damping", "algorithmic", "unbalanced")
_STATE = ("kinetic", "strain", "gravity")
_AXES = ("x", "y", "z")


class Ledger:
    """The account of a motion, from its start on.

    Attributes
    ----------
    rows : list of dict
        Energies in J and momenta in kg m/s and kg m²/s (in the plane per metre) by name.
    """

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._done = dict.fromkeys(_DONE, 0.0)
        self._kinetic = self._strain = 0.0

    def open(self, body: MovingBody, state: State) -> None:
        """Begin with a state. When a cut opens nothing changes."""
        self._kinetic, self._strain = _energies(body, state)

    def started(self, body: MovingBody, state: State) -> None:
        """Enter what supports did that took up another velocity at once."""
        kinetic = self._kinetic
        self._kinetic, self._strain = _energies(body, state)
        self._done["work_of_supports"] += self._kinetic - kinetic

    def record(self, body: MovingBody, before: State, state: State, forces: StepForces) -> None:
        """Enter one step."""
        change = state.displacement - before.displacement
        reaction = np.zeros_like(change)
        reaction[body.held] = -forces.residual[body.held]
        kinetic, strain = _energies(body, state)
        slip = change @ forces.inertia - (kinetic - self._kinetic)
        done = self._done
        done["work_of_loads"] += float(change @ (forces.external - body.weight))
        done["work_of_supports"] += float(change @ reaction)
        done["damping"] += float(change @ forces.viscous)
        done["algorithmic"] += float(slip + change @ forces.internal - (strain - self._strain))
        done["unbalanced"] -= float(change @ (forces.residual + reaction))
        self._kinetic, self._strain = kinetic, strain

    def enter(self, body: MovingBody, state: State) -> None:
        """Enter a row for a state that is put out."""
        row = {
            "kinetic": self._kinetic,
            "strain": self._strain,
            "gravity": -float(body.weight @ state.displacement),
            **self._done,
        }
        done = self._done
        row["total"] = sum(row[name] for name in _STATE) - done["work_of_loads"]
        row["total"] += done["damping"] + done["algorithmic"] - done["work_of_supports"]
        d = body.space.dimension
        momenta = (body.mass @ state.velocity).reshape(-1, d)
        places = body.space.node_points + state.displacement.reshape(-1, d)
        row |= _components("linear_momentum", momenta.sum(axis=0))
        row |= _components("angular_momentum", _turning(places, momenta))
        self.rows.append(row)

    def columns(self) -> dict[str, Array]:
        """All entries (t,) by name."""
        names = self.rows[0] if self.rows else {}
        return {name: np.array([row[name] for row in self.rows]) for name in names}


def _energies(body: MovingBody, state: State) -> tuple[float, float]:
    kinetic = 0.5 * float(state.velocity @ (body.mass @ state.velocity))
    return kinetic, body.law.energy(state.displacement)


def _turning(places: Array, momenta: Array) -> Array:
    if places.shape[1] == 2:
        return np.array([np.sum(places[:, 0] * momenta[:, 1] - places[:, 1] * momenta[:, 0])])
    turning: Array = np.cross(places, momenta).sum(axis=0)
    return turning


def _components(name: str, vector: Array) -> dict[str, float]:
    axes = ("z",) if len(vector) == 1 else _AXES[: len(vector)]
    return {f"{name}_{axis}": float(x) for axis, x in zip(axes, vector, strict=True)}
