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
DONE = ("work_of_loads", "work_of_supports", "damping", "algorithmic", "unbalanced", "cut_work")


class Ledger:
    """The account of a motion, from its start on.

    Attributes
    ----------
    done : dict of str to float
        What was done since then by the names in `DONE`, J (in the plane per metre).
    turned : (1 or 3,) array or float
        Angular impulse since then of the forces on what the cut has released, N m s.
    """

    def __init__(self) -> None:
        self.done = dict.fromkeys(DONE, 0.0)
        self.turned: Array | float = 0.0
        self._kinetic = self._strain = 0.0

    def open(self, body: MovingBody, state: State) -> None:
        """Begin with a state. When a cut opens nothing changes."""
        self._kinetic, self._strain = _energies(body, state)

    def started(self, body: MovingBody, state: State) -> None:
        """Enter what supports did that took up another velocity at once."""
        kinetic = self._kinetic
        self._kinetic, self._strain = _energies(body, state)
        self.done["work_of_supports"] += self._kinetic - kinetic

    def record(self, body: MovingBody, before: State, state: State, forces: StepForces) -> None:
        """Enter one step."""
        change = state.displacement - before.displacement
        reaction = np.zeros_like(change)
        reaction[body.held] = -forces.residual[body.held]
        kinetic, strain = _energies(body, state)
        slip = change @ forces.inertia - (kinetic - self._kinetic)
        done = self.done
        done["work_of_loads"] += float(change @ (forces.external - body.weight - forces.held))
        done["cut_work"] -= float(change @ forces.held)
        d = body.space.dimension
        middle = 0.5 * (before.displacement + state.displacement).reshape(-1, d)
        turning = _turning(body.space.node_points + middle, forces.held.reshape(-1, d))
        self.turned = self.turned + (state.time - before.time) * turning
        done["work_of_supports"] += float(change @ reaction)
        done["damping"] += float(change @ forces.viscous)
        done["algorithmic"] += float(slip + change @ forces.internal - (strain - self._strain))
        done["unbalanced"] -= float(change @ (forces.residual + reaction))
        self._kinetic, self._strain = kinetic, strain

    def state(self, body: MovingBody, state: State) -> dict[str, float]:
        """Energies of the state that was entered last, J."""
        gravity = -float(body.weight @ state.displacement)
        return {"kinetic": self._kinetic, "strain": self._strain, "gravity": gravity}


def momenta_of(body: MovingBody, state: State) -> tuple[Array, Array]:
    """Linear (d,) and angular momentum (1 or 3,) of a state, kg m/s and kg m²/s."""
    d = body.space.dimension
    momenta = (body.mass @ state.velocity).reshape(-1, d)
    places = body.space.node_points + state.displacement.reshape(-1, d)
    return momenta.sum(axis=0), _turning(places, momenta)


def _energies(body: MovingBody, state: State) -> tuple[float, float]:
    kinetic = 0.5 * float(state.velocity @ (body.mass @ state.velocity))
    return kinetic, body.law.energy(state.displacement)


def _turning(places: Array, momenta: Array) -> Array:
    if places.shape[1] == 2:
        return np.array([np.sum(places[:, 0] * momenta[:, 1] - places[:, 1] * momenta[:, 0])])
    turning: Array = np.cross(places, momenta).sum(axis=0)
    return turning
