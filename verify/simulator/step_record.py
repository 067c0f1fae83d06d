"""Records of the steps of a simulated scene: cost and events, and how many meet a limit of time.

Only the phases are timed: all that a simulator does in a step. The record itself, the account of
energies and the measures of `verify.simulator.quality` are kept beside it.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from verify.xfem.arrays import Floats

# in the order in which a step goes through them
PHASES = ("cutting", "assembly", "motion", "mapping", "collision")
LIMITS = {"1 ms": 1e-3, "2 ms": 2e-3, "1/60 s": 1.0 / 60.0}  # touch, and sight


@dataclass(frozen=True)
class StepRecord:
    """One step.

    Attributes
    ----------
    step : int
        From 1 on.
    time : float
        At its end, s.
    seconds : dict
        Wall time of each of the `PHASES`: cutting (which elements, their parts and unknowns, the
        surfaces split), assembly (mass, supports and solver of the body where it has changed),
        motion (forces, factorisation, solve), mapping (positions of all surfaces), collision
        (boxes refitted, the tool queried).
    split : int
        Elements split so far.
    newly_split : int
        In this step.
    unknowns : int
        Unknown displacement components.
    delay : (k,) float array
        Of the elements split in this step: from the first edge that the tool passed to the last
        one, s of the scene (Table 4.6).
    kinetic, strain : float
        J (in the plane per metre of thickness).
    potential : float
        Of the weight, J.
    work : float
        Done on the body by hooks, supports and the tool since the start, J; NaN where no account
        is kept.
    dissipated : float
        By damping and by the scheme since the start, J; likewise.
    contacts : int
        Facets of the collision surface that the tool touches.
    """

    step: int
    time: float
    seconds: dict[str, float]
    split: int
    newly_split: int
    unknowns: int
    delay: Floats
    kinetic: float
    strain: float
    potential: float
    work: float
    dissipated: float
    contacts: int

    @property
    def total_seconds(self) -> float:
        """Wall time of the step."""
        return sum(self.seconds.values())

    @property
    def mechanical(self) -> float:
        """Kinetic, strain and gravity energy, J."""
        return self.kinetic + self.strain + self.potential


@dataclass(frozen=True)
class Spread:
    """Distribution of some seconds.

    Attributes
    ----------
    count : int
    median, most, largest : float
        Half of them, 95 % of them, and all of them are at most that, s; NaN if there are none.
    within : dict
        Share within each of the `LIMITS`.
    """

    count: int
    median: float
    most: float
    largest: float
    within: dict[str, float]

    @classmethod
    def of(cls, seconds: Iterable[float]) -> "Spread":
        """Sum up seconds."""
        found = np.array(list(seconds))
        if len(found) == 0:
            return cls(0, float("nan"), float("nan"), float("nan"), {})
        median, most, largest = np.quantile(found, (0.5, 0.95, 1.0))
        within = {name: float(np.mean(found <= limit)) for name, limit in LIMITS.items()}
        return cls(len(found), float(median), float(most), float(largest), within)
